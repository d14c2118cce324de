#!/usr/bin/env bash
# Renders the K-th of N shards of an image; goes on from its state if there is one.
#
#     shard.sh SCENE FOLDER K N SAMPLES
#
# SAMPLES are a number of samples per pixel, taken evenly, or an EXR of `prpf allocate` with a number for each pixel. FOLDER is
# shared by all machines. The state of the shard is FOLDER/K.state.
set -euo pipefail
scene=$1 folder=$2 shard=$3 shards=$4 samples=$5

mkdir -p "$folder"
if [[ $samples == *.exr ]]; then
    placement=(--sample-map "$samples" --sample-map-values absolute)
else
    # Uniform sampling, so that all shards together are one render to the last bit.
    placement=(--sampling uniform --spp "$samples")
fi
# The merged state is denoised.
exec prpf render "$scene" --shard "$shard/$shards" "${placement[@]}" --denoiser none \
    --state "$folder/$shard.state" --resume -o "$folder/$shard.png"

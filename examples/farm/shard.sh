#!/usr/bin/env bash
# Renders the K-th of N shards of an image; goes on from its state if there is one.
#
#     shard.sh SCENE FOLDER K N SPP
#
# FOLDER is shared by all machines. The state of the shard is FOLDER/K.state.
set -euo pipefail
scene=$1 folder=$2 shard=$3 shards=$4 spp=$5

mkdir -p "$folder"
# Uniform sampling, so that all shards together are one render to the last bit. The merged state is denoised.
exec prpf render "$scene" --shard "$shard/$shards" --spp "$spp" --sampling uniform --denoiser none \
    --state "$folder/$shard.state" --resume -o "$folder/$shard.png" --quiet

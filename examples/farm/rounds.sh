#!/usr/bin/env bash
# Renders an image in rounds of N shards, whose samples are placed by the maps of all shards together. The shards of a round run
# one after the other here; on a farm they are jobs of their own, and merge and allocation are one that depends on them.
#
#     rounds.sh SCENE FOLDER N SPP IMAGE
#
# The first round has a quarter of the SPP samples per pixel, evenly, the second adds as many, and the third the rest. A shard
# needs two samples per pixel of the first round: N is at most SPP / 8.
set -euo pipefail
scene=$1 folder=$2 shards=$3 spp=$4 image=$5

mkdir -p "$folder"
first=$((spp / 4))
placement=(--sampling uniform --spp "$first")
for total in "$((2 * first))" "$spp" ''; do
    states=()
    for ((shard = 1; shard <= shards; shard++)); do
        states+=("$folder/$shard.state")
        prpf render "$scene" --shard "$shard/$shards" "${placement[@]}" --denoiser none \
            --state "$folder/$shard.state" --resume -o "$folder/$shard.png" --quiet
    done
    prpf merge "${states[@]}" -o "$folder/all.state" --quiet
    if [[ -n $total ]]; then
        prpf allocate "$folder/all.state" --spp "$total" -o "$folder/counts.exr" --quiet
        placement=(--sample-map "$folder/counts.exr" --sample-map-values absolute)
    fi
done
prpf denoise "$folder/all.state" --denoiser nlm -o "$image"

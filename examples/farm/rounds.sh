#!/usr/bin/env bash
# Renders an image in three rounds of N shards, whose samples are placed by the maps of all shards together. The shards of a
# round run one after the other here; slurm_rounds.sh runs them at the same time.
#
#     rounds.sh SCENE FOLDER N SPP IMAGE
#
# The first round has a quarter of the SPP samples per pixel, evenly, the second adds as many, and the third the rest. A shard
# needs two samples per pixel of the first round: N is at most SPP / 8. The same command goes on after an interruption.
set -euo pipefail
here=$(dirname "$0")
scene=$1 folder=$2 shards=$3 spp=$4 image=$5
if ! [[ "$shards $spp" =~ ^[1-9][0-9]*\ [1-9][0-9]*$ ]] || ((spp < 8 * shards)); then
    echo "rounds.sh: found $shards shards and $spp samples per pixel; accepted are at least 8 samples for each shard" >&2
    exit 2
fi

first=$((spp / 4))
samples=$first
for total in "$((2 * first))" "$spp" ''; do
    for ((shard = 1; shard <= shards; shard++)); do
        "$here/shard.sh" "$scene" "$folder" "$shard" "$shards" "$samples"
    done
    if [[ -n $total ]]; then
        samples=$folder/counts-$total.exr
        "$here/merge.sh" "$folder" "$shards" "$samples" "$total"
    fi
done
"$here/merge.sh" "$folder" "$shards" "$image"

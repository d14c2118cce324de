#!/usr/bin/env bash
# Merges the N shards of FOLDER and denoises them.
#
#     merge.sh FOLDER N IMAGE
set -euo pipefail
folder=$1 shards=$2 image=$3

states=()
for ((shard = 1; shard <= shards; shard++)); do
    states+=("$folder/$shard.state")
done
if ((shards == 1)); then
    cp "${states[0]}" "$folder/all.state"
else
    prpf merge "${states[@]}" -o "$folder/all.state"
fi
prpf denoise "$folder/all.state" --denoiser nlm -o "$image"

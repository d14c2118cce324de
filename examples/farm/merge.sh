#!/usr/bin/env bash
# Merges the N shards of FOLDER, and denoises them.
#
#     merge.sh FOLDER N IMAGE
#     merge.sh FOLDER N COUNTS.exr SPP
#
# The second form writes how many samples each pixel is to have in a render of SPP samples per pixel, unless COUNTS.exr exists.
set -euo pipefail
# Where Slurm binds no tasks to cores, a program sees all cores of the node
[[ -z ${SLURM_CPUS_PER_TASK:-} ]] || export RAYON_NUM_THREADS=$SLURM_CPUS_PER_TASK
folder=$1 shards=$2 output=$3 spp=${4:-}

# Shards that were placed by these counts may have gone on.
if [[ -n $spp && -e $output ]]; then
    exit
fi
states=()
for ((shard = 1; shard <= shards; shard++)); do
    states+=("$folder/$shard.state")
done
if ((shards == 1)); then
    cp "${states[0]}" "$folder/all.state"
else
    prpf merge "${states[@]}" -o "$folder/all.state" --quiet
fi
if [[ -n $spp ]]; then
    prpf allocate "$folder/all.state" --spp "$spp" -o "$output" --quiet
else
    prpf denoise "$folder/all.state" --denoiser learned -o "$output"
fi

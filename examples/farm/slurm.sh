#!/usr/bin/env bash
# Renders an image as a Slurm job array of shards, and merges them in a job that depends on it.
#
#     slurm.sh SCENE IMAGE SHARDS SPP [OPTION OF SBATCH]...
#
# The folder IMAGE.shards, on a file system that all nodes share, gets the states and the logs. The same command goes on after
# a failed or cancelled job.
set -euo pipefail
here=$(dirname "$(realpath "$0")")
scene=$(realpath "$1") image=$(realpath -m "$2") shards=$3 spp=$4
shift 4
folder=$image.shards
mkdir -p "$folder"

# A minute before the time limit Slurm sends SIGTERM, at which prpf writes its state.
array=$(sbatch --parsable --job-name=prpf-shard --array="1-$shards" --requeue --signal=TERM@60 \
    --output="$folder/%a.log" --open-mode=append "$@" "$here/slurm_shard.sh" \
    "$here" "$scene" "$folder" "$shards" "$spp")
# Where there are several clusters, sbatch prints ID;CLUSTER.
sbatch --parsable --job-name=prpf-merge --kill-on-invalid-dep=yes --dependency="afterok:${array%%;*}" \
    --output="$folder/merge.log" "$@" "$here/merge.sh" "$folder" "$shards" "$image"

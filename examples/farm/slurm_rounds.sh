#!/usr/bin/env bash
# Renders an image in three rounds of a Slurm job array of shards: after each array a job merges the shards, and decides by the
# maps of all of them where the samples of the next one go. See rounds.sh for the samples of each round.
#
#     slurm_rounds.sh SCENE IMAGE SHARDS SPP [OPTION OF SBATCH]...
#
# The folder IMAGE.rounds, on a file system that all nodes share, gets the states and the logs. The same command goes on after
# a failed or cancelled job. Prints the number of the last job.
set -euo pipefail
here=$(dirname "$(realpath "$0")")
scene=$(realpath "$1") image=$(realpath -m "$2") shards=$3 spp=$4
shift 4
if ! [[ "$shards $spp" =~ ^[1-9][0-9]*\ [1-9][0-9]*$ ]] || ((spp < 8 * shards)); then
    echo "slurm_rounds.sh: found $shards shards and $spp samples per pixel; accepted are at least 8 samples for each shard" >&2
    exit 2
fi
folder=$image.rounds
mkdir -p "$folder"

first=$((spp / 4))
samples=$first
after=()
for total in "$((2 * first))" "$spp" ''; do
    # A minute before the time limit Slurm sends SIGTERM, at which prpf writes its state. Before 4.4 bash takes an empty array
    # as unset.
    array=$(sbatch --parsable --job-name=prpf-shard --array="1-$shards" --requeue --signal=TERM@60 --kill-on-invalid-dep=yes \
        ${after[@]+"${after[@]}"} --output="$folder/%a.log" --open-mode=append "$@" "$here/slurm_shard.sh" \
        "$here" "$scene" "$folder" "$shards" "$samples")
    samples=$folder/counts-$total.exr
    output=("$samples" "$total")
    [[ -n $total ]] || output=("$image")
    merge=$(sbatch --parsable --job-name=prpf-merge --kill-on-invalid-dep=yes --dependency="afterok:${array%%;*}" \
        --output="$folder/merge.log" --open-mode=append "$@" "$here/merge.sh" "$folder" "$shards" "${output[@]}")
    # Where there are several clusters, sbatch prints ID;CLUSTER.
    merge=${merge%%;*}
    after=(--dependency="afterok:$merge")
done
echo "$merge"

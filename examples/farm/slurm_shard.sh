#!/usr/bin/env bash
# One task of the job arrays of slurm.sh and slurm_rounds.sh: HERE SCENE FOLDER SHARDS SAMPLES (see shard.sh).
set -euo pipefail
here=$1 scene=$2 folder=$3 shards=$4 samples=$5

status=0
# Since Slurm 22.05 a step does not take --cpus-per-task from its job.
srun --ntasks=1 ${SLURM_CPUS_PER_TASK:+--cpus-per-task="$SLURM_CPUS_PER_TASK"} "$here/shard.sh" "$scene" "$folder" "$SLURM_ARRAY_TASK_ID" "$shards" "$samples" || status=$?
# Stopped before its end, with its state written: the task waits in the queue again, and goes on from there.
if ((status == 130)); then
    scontrol requeue "${SLURM_ARRAY_JOB_ID}_$SLURM_ARRAY_TASK_ID"
fi
exit "$status"

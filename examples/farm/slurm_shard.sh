#!/usr/bin/env bash
# One task of the job arrays of slurm.sh and slurm_rounds.sh: HERE SCENE FOLDER SHARDS SAMPLES (see shard.sh).
set -euo pipefail
# Where Slurm binds no tasks to cores, a program sees all cores of the node
[[ -z ${SLURM_CPUS_PER_TASK:-} ]] || export RAYON_NUM_THREADS=$SLURM_CPUS_PER_TASK
here=$1 scene=$2 folder=$3 shards=$4 samples=$5

# Prints which version of the state there is, if any: a write replaces the file.
state_version() {
    stat --format='%i %y' "$folder/$SLURM_ARRAY_TASK_ID.state" 2> /dev/null || true
}

before=$(state_version)
status=0
# Since Slurm 22.05 a step does not take --cpus-per-task from its job.
srun --ntasks=1 ${SLURM_CPUS_PER_TASK:+--cpus-per-task="$SLURM_CPUS_PER_TASK"} \
    "$here/shard.sh" "$scene" "$folder" "$SLURM_ARRAY_TASK_ID" "$shards" "$samples" || status=$?
# Stopped before its end, with its state written: the task waits in the queue again, and goes on from there. A task that is
# stopped while it reads the scene writes none, and would wait and read for ever.
if ((status == 130)) && [[ $(state_version) != "$before" ]]; then
    scontrol requeue "${SLURM_ARRAY_JOB_ID}_$SLURM_ARRAY_TASK_ID"
fi
exit "$status"

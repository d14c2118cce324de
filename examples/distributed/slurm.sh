#!/usr/bin/env bash
# Renders one image by several processes, on the nodes that Slurm gives: submit with
#
#     sbatch --ntasks=8 --cpus-per-task=16 --time=60 slurm.sh SCENE IMAGE [OPTION OF PRPF RENDER]...
#
# The state IMAGE.state, on a file system that all nodes share, is written from time to time and a minute before the time
# limit; then the job waits in the queue again, and goes on from there. A job that is stopped while it reads the scene ends.
#SBATCH --job-name=prpf
#SBATCH --requeue
#SBATCH --open-mode=append
#SBATCH --signal=TERM@60
set -euo pipefail
# Where Slurm binds no tasks to cores, a program sees all cores of the node
[[ -z ${SLURM_CPUS_PER_TASK:-} ]] || export RAYON_NUM_THREADS=$SLURM_CPUS_PER_TASK
scene=$1 image=$2
shift 2

# Prints which version of the state there is, if any: a write replaces the file.
state_version() {
    stat --format='%i %y' "$image.state" 2> /dev/null || true
}

before=$(state_version)
# A slot for each process, and as many cores as --cpus-per-task says.
status=0
srun --kill-on-bad-exit=1 --cpus-per-task="${SLURM_CPUS_PER_TASK:-1}" ${PRPF_MPI:+--mpi="$PRPF_MPI"} \
    prpf render "$scene" -o "$image" --state "$image.state" --resume "$@" || status=$?
# Stopped before its end, with its state written
if ((status == 130)) && [[ $(state_version) != "$before" ]]; then
    scontrol requeue "$SLURM_JOB_ID"
fi
exit "$status"

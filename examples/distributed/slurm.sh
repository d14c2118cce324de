#!/usr/bin/env bash
# Renders one image by several processes, on the nodes that Slurm gives: submit with
#
#     sbatch --ntasks=8 --cpus-per-task=16 --time=60 slurm.sh SCENE IMAGE [OPTION OF PRPF RENDER]...
#
# The state IMAGE.state, on a file system that all nodes share, is written from time to time and a minute before the time
# limit; then the job waits in the queue again, and goes on from there.
#SBATCH --job-name=prpf
#SBATCH --requeue
#SBATCH --open-mode=append
#SBATCH --signal=TERM@60
set -euo pipefail
scene=$1 image=$2
shift 2

# A slot for each process, and as many cores as --cpus-per-task says.
status=0
srun --kill-on-bad-exit=1 --cpus-per-task="${SLURM_CPUS_PER_TASK:-1}" ${PRPF_MPI:+--mpi="$PRPF_MPI"} \
    prpf render "$scene" -o "$image" --state "$image.state" --resume "$@" || status=$?
# Stopped before its end, with its state written
if ((status == 130)); then
    scontrol requeue "$SLURM_JOB_ID"
fi
exit "$status"

#!/usr/bin/env bash
# The job of slurm.sh that depends on the array: HERE FOLDER SHARDS IMAGE.
set -euo pipefail
exec "$1/merge.sh" "$2" "$3" "$4"

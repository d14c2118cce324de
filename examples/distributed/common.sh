# What check and check_kills have in common: sourced in this folder. Sets $folder, which is removed at the end, and $scene; ends
# the script where there is no mpirun.
PATH=$(realpath "${CARGO_TARGET_DIR:-../../target}")/release:$PATH
export PATH
# Of Open MPI without its blocks of text, or another launcher: that of MPICH is PRPF_MPIRUN='mpiexec.hydra'.
read -ra launcher <<< "${PRPF_MPIRUN:-mpirun -q}"
is_mpich=$([[ ${PRPF_MPIRUN:-} == *mpich* || ${PRPF_MPIRUN:-} == *hydra* ]] && echo 1 || echo 0)
if ! command -v "${launcher[0]}" > /dev/null; then
    echo "skipped: renders by several processes, for which ${launcher[0]} is needed (openmpi-bin)"
    exit
fi
# More processes than cores, and the user of a container.
export OMPI_MCA_rmaps_base_oversubscribe=1 OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
scene=../../scenes/pool/pool.pbrt

# Renders by some processes: N NAME [OPTION]...
render() {
    local processes=$1 name=$folder/$2
    shift 2
    local command=(prpf render "$scene" --resolution 112x80 --threads 1 --quiet)
    ((processes == 1)) || command=("${launcher[@]}" -n "$processes" "${command[@]}")
    command+=(-o "$name.exr" --state "$name.state" --report "$name.json" "$@")
    # In the background, signals are to reach the launcher and not a shell.
    ((BASH_SUBSHELL == 0)) || exec "${command[@]}"
    "${command[@]}"
}

# Kills the process of this number, from 1, of those that a launcher has started, and prints its identity; nothing if there is
# none.
kill_process() {
    local children process
    children=$(pgrep -d , -P "$1" || true)
    process=$(pgrep -P "$1${children:+,$children}" prpf | sort -n | sed -n "${2}p" || true)
    [[ -z $process ]] || { kill -KILL "$process" 2> /dev/null && echo "$process"; } || true
}

# Compares states, apart from their headers, in which times are, images, and the estimates of their errors.
same() {
    python3 - "$folder/$1.state" "$folder/$2.state" "$folder/$1.json" "$folder/$2.json" << 'END'
import json, struct, sys
def estimate(path):
    with open(path) as report:
        return json.load(report)["estimated_error"]
def arrays(path):
    data = open(path, "rb").read()
    return data[28 + struct.unpack("<Q", data[20:28])[0] : -4]
first, second = map(arrays, sys.argv[1:3])
if first != second:
    sys.exit(f"{sys.argv[2]}: other statistics than {sys.argv[1]}")
first, second = map(estimate, sys.argv[3:])
sys.exit(f"{sys.argv[4]}: {second}, in {sys.argv[3]} {first}" if first != second else 0)
END
    prpf compare "$folder/$1.exr" "$folder/$2.exr" --max-relmse 0 > /dev/null
}

# What check and check_kills have in common: sourced in this folder. Sets $folder, which is removed at the end, and $scene; ends
# the script where there is no mpirun.
PATH=$(realpath "${CARGO_TARGET_DIR:-../../target}")/release:$PATH
export PATH
if ! command -v mpirun > /dev/null; then
    echo 'skipped: renders by several processes, for which mpirun is needed (openmpi-bin)'
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
    local launcher=(mpirun -q -n "$processes")
    ((processes == 1)) && launcher=()
    local command=("${launcher[@]}" prpf render "$scene" --resolution 112x80 --threads 1 --quiet)
    command+=(-o "$name.exr" --state "$name.state" "$@")
    # In the background, signals are to reach the launcher and not a shell.
    ((BASH_SUBSHELL == 0)) || exec "${command[@]}"
    "${command[@]}"
}

# Compares states, apart from their headers, in which times are, and images.
same() {
    python3 - "$folder/$1.state" "$folder/$2.state" << 'END'
import struct, sys
def arrays(path):
    data = open(path, "rb").read()
    return data[28 + struct.unpack("<Q", data[20:28])[0] : -4]
first, second = map(arrays, sys.argv[1:])
sys.exit(f"{sys.argv[2]}: other statistics than {sys.argv[1]}" if first != second else 0)
END
    prpf compare "$folder/$1.exr" "$folder/$2.exr" --max-relmse 0 > /dev/null
}

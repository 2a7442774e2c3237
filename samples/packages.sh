# shellcheck shell=bash disable=SC2034
# The Debian 12 packages this project needs, and how they come onto the machine.  Read by samples/run.sh and
# the scripts of tests/: this is the only list.

packages_to_build="build-essential cmake ninja-build pkg-config pocl-opencl-icd ocl-icd-opencl-dev opencl-headers
libpcl-dev libeigen3-dev libboost-dev libembree-dev libopenvdb-dev libtbb-dev libmeshoptimizer-dev libjansson-dev
libpng-dev libjpeg62-turbo-dev liblzf-dev zlib1g-dev libzstd-dev libxxhash-dev"

packages_to_test="libcmocka-dev bats clang-format-14 clang-14 libclang-rt-14-dev python3-numpy python3-venv python3-vtk9 blender
file patchelf libxml2-utils parallel slurmctld slurmd slurm-client munge chromium"
# Node from elsewhere brings an npm that Debian's would not go with.
command -v npm >/dev/null || packages_to_test="$packages_to_test nodejs npm"

# For tests/clean_machine.sh.
packages_to_make_roots="debootstrap git"

# Install those of the named packages that are missing; says what it installs, and more only where that fails.
install_packages()
{
    local missing="" package as_root="" log
    for package in "$@"; do
        case $(dpkg-query -W -f='${db:Status-Status}' "$package" 2>/dev/null) in
            installed) ;;
            *) missing="$missing $package" ;;
        esac
    done
    [ -n "$missing" ] || return 0
    if [ "$(id -u)" -ne 0 ]; then
        if ! command -v sudo >/dev/null; then
            echo "These packages are missing, and neither root nor sudo is at hand to install them:$missing" >&2
            return 1
        fi
        as_root="sudo"
    fi
    echo "Installing, which can take some minutes:$missing"
    log=$(mktemp)
    # shellcheck disable=SC2086  # the lists are meant to be split
    if ! { $as_root apt-get update -qq && $as_root env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq \
        --no-install-recommends -o Acquire::Retries=3 $missing; } >"$log" 2>&1; then
        tail -n 30 "$log" >&2
        echo "The packages could not be installed; all that apt-get said is in $log" >&2
        return 1
    fi
    rm -f "$log"
}

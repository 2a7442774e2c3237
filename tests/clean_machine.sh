#!/bin/bash
# A clean machine: runs the README's first command, samples/run.sh, in a new minimal root of this machine's Debian
# release, with nothing in it but what that command installs, and checks the meshes, report and picture it promises;
# then the README's other commands.
#
#   tests/clean_machine.sh [--user] [--tests]
#   tests/clean_machine.sh --packages FOLDER
#
#   --user    as an ordinary user with sudo; else as root
#   --tests   then all of the tests, tests/run.sh, in the same root
#   --packages  instead of all that: installs the .deb files and the wheel of FOLDER (tools/release.sh, or cpack and
#             tools/python/make_wheel.py) in a root that has neither sources nor compilers, and uses each from there
#
# The clone in the root has what is committed.  Package sources, proxies and name servers are those of this machine.
# Package files are kept in NEUPIG_DEBS (/var/cache/neupig/debs) for the next time; pages of manuals are left out.
# Takes about 6 minutes and 5 GB below TMPDIR (/var/tmp), with --tests 30 minutes and 12 GB; needs root, or sudo that
# asks for no password.  Ends with 0, with 1 where something fails in the root, with 77 where no root can be made.
# Mounts and root are gone at the end however that comes, kill -9 included.
set -euo pipefail
self=$(realpath "$0")
cd "$(dirname "$self")/.."

cannot()
{
    echo "clean_machine.sh: no root can be made here: $*" >&2
    exit 77
}

failed()
{
    echo "clean_machine.sh: $*" >&2
    exit 1
}

# ---- inside: in a namespace of mounts and processes, which all end with it ----

# "URI SUITE NAME" of every source of Debian's main section that apt has.
debian_sources()
{
    # shellcheck disable=SC2016  # the names are apt's
    apt-get indextargets --format '$(ORIGIN) $(REPO_URI) $(RELEASE) $(CODENAME)' 'Created-By: Packages' \
        'Component: main' "Architecture: $(dpkg --print-architecture)" | sed -n 's/^Debian //p' | sort -u
}

# What apt needs to reach the sources from the root as it does from here: their list, proxies and certificates,
# passwords, keys.  Hooks and sources of others stay outside.
carry_apt_settings() # ROOT SOURCES
{
    local root=$1 file
    awk '{ print "deb", $1, $2, "main" }' <<<"$2" >"$root/etc/apt/sources.list"
    apt-config dump --no-empty | grep '^Acquire::' | grep -v '^Acquire::IndexTargets::' >"$root/etc/apt/apt.conf.d/50host"
    sed -n 's/.* "\(\/[^"]*\)";$/\1/p' "$root/etc/apt/apt.conf.d/50host" | while read -r file; do
        [ ! -f "$file" ] || install -D "$file" "$root$file"
    done
    for file in auth.conf auth.conf.d trusted.gpg trusted.gpg.d; do
        [ ! -e "/etc/apt/$file" ] || cp -rL "/etc/apt/$file" "$root/etc/apt/"
    done
}

# Names and certificates as here.
carry_network_settings() # ROOT
{
    cp -L /etc/resolv.conf "$1/etc/resolv.conf"
    cp -L /etc/hosts "$1/etc/hosts"
    grep -qw "$(hostname)" "$1/etc/hosts" || echo "127.0.0.1 $(hostname)" >>"$1/etc/hosts"
    if [ -d /usr/local/share/ca-certificates ]; then
        mkdir -p "$1/usr/local/share"
        cp -rL /usr/local/share/ca-certificates "$1/usr/local/share/"
    fi
}

# debootstrap knows proxies by these names alone.
export_proxies()
{
    local scheme name proxy=""
    for scheme in http https; do
        name=${scheme}_proxy
        [ -z "${!name:-}" ] || continue
        eval "$(apt-config shell proxy "Acquire::$scheme::Proxy")"
        case $proxy in "" | DIRECT) ;; *) export "$name=$proxy" ;; esac
        proxy=""
    done
}

# Packages are unpacked without waiting for the disk after each file, and without what no program reads.
hasten_packages() # ROOT
{
    printf '%s\n' force-unsafe-io path-exclude=/usr/share/{doc,man,info,locale}/'*' >"$1/etc/dpkg/dpkg.cfg.d/hasty"
    echo 'Acquire::Languages "none";' >"$1/etc/apt/apt.conf.d/60hasty"
}

# Package files between here and there: links where both lie on one disk.
carry_debs() # FROM TO
{
    find "$1" -maxdepth 1 -name '*.deb' -exec cp -nl -t "$2" {} + 2>/dev/null ||
        find "$1" -maxdepth 1 -name '*.deb' -exec cp -n -t "$2" {} + || true
}

make_root() # ROOT LOG PACKAGES...
{
    local root=$1 log=$2 packages="" release sources uri
    shift 2
    release=$(. /etc/os-release && echo "${VERSION_CODENAME:-}")
    sources=$(debian_sources)
    if [ -z "$sources" ]; then # the lists that say whose sources these are may have been cleaned away
        apt-get update -qq >"$log" 2>&1 || true
        sources=$(debian_sources)
    fi
    uri=$(awk -v release="$release" '$3 == release { print $1; exit }' <<<"$sources")
    [ -n "$uri" ] || cannot "apt has no source of Debian's release \"$release\""
    [[ $sources != *https://* ]] || set -- "$@" ca-certificates
    [ $# -eq 0 ] || packages=--include=$(IFS=, && echo "$*")
    export_proxies
    # shellcheck disable=SC2086  # no option where there is none
    debootstrap --variant=minbase --cache-dir="$debs" $packages "$release" "$root" "$uri" >"$log" 2>&1 </dev/null || {
        tail -n 20 "$log" >&2
        cannot "debootstrap failed"
    }
    carry_apt_settings "$root" "$sources"
    carry_network_settings "$root"
    hasten_packages "$root"
    carry_debs /var/cache/apt/archives "$root/var/cache/apt/archives"
    carry_debs "$debs" "$root/var/cache/apt/archives"
    mountpoint -q "$root/proc" || mount -t proc proc "$root/proc" || cannot "proc can't be mounted"
    mount --rbind /sys "$root/sys" && mount --rbind /dev "$root/dev" || cannot "sys and dev can't be mounted"
}

# The account that follows the README: "HOME NAME".
make_account() # ROOT AS_USER
{
    if [ "$2" = no ]; then
        echo /root root
        return
    fi
    chroot "$1" useradd --create-home --shell /bin/bash walker
    echo "walker ALL=(ALL) NOPASSWD: ALL" >"$1/etc/sudoers.d/walker"
    echo /home/walker walker
}

# A repository may belong to somebody else than root, and git is careful with such.
put_in_clone() # ROOT HOME NAME
{
    local scratch
    scratch=$(dirname "$1")
    printf '[safe]\n\tdirectory = *\n[advice]\n\tdetachedHead = false\n' >"$scratch/gitconfig"
    GIT_CONFIG_GLOBAL=$scratch/gitconfig git clone --quiet --no-hardlinks . "$1$2/neupig" ||
        failed "git can't clone $PWD"
    chroot "$1" chown -R "$3:" "$2/neupig"
    git -c safe.directory="$PWD" diff --quiet HEAD || echo "Note: changes that are not committed are not in the clone."
}

# A command line in the clone.
in_clone() # ROOT HOME NAME COMMAND
{
    local path=/usr/local/bin:/usr/bin:/bin name settings=()
    [ "$3" != root ] || path=/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin
    for name in http_proxy https_proxy no_proxy; do
        [ -z "${!name:-}" ] || settings+=("$name=${!name}")
    done
    chroot --userspec="$3:$3" "$1" env -i --default-signal HOME="$2" USER="$3" LOGNAME="$3" PATH="$path" LANG=C.UTF-8 \
        TERM=dumb "${settings[@]}" bash -c "cd ~/neupig && $4" </dev/null
}

# The line of the README that begins with this script.
readme_command() # README SCRIPT
{
    grep -m 1 -oE "^ *(\\$ )?$2( .*)?\$" "$1" | sed 's/^[ $]*//' || failed "the README has no command $2"
}

# The path that the first command's output names for a thing.
promised() # LOG THING
{
    sed -n "s/^$2 \\+//p" "$1" | tail -n 1
}

# Which of a PLY's header lines and sizes every mesh must share.
mesh_shape() # FILE
{
    grep -a -m 2 '^element ' "$1" | tr '\n' ' '
    stat -c %s "$1"
}

check_meshes() # FOLDER CAPTURE; sets faces
{
    local shapes count file
    count=$(find "$1" -name '*.ply' | wc -l)
    [ "$count" -gt 1 ] && [ "$count" -eq "$(find "$2" -name '*.ply' | wc -l)" ] ||
        failed "$count meshes in $1 are not one for each frame of $2"
    shapes=$(for file in "$1"/*.ply; do mesh_shape "$file"; done | sort | uniq -c)
    [ "$(wc -l <<<"$shapes")" -eq 1 ] || failed "the meshes differ in more than their positions: $shapes"
    faces=$(sed -n 's/.*element face \([0-9]*\).*/\1/p' <<<"$shapes")
    [ "${faces:-0}" -ge 1000 ] || failed "the meshes have ${faces:-no} faces"
    echo "meshes:  $count of $faces faces"
}

# JSON as a parser sees it; a root has no other than that of CMake, which the first command has brought.
check_report() # ROOT REPORT FACES
{
    local faces
    cat >"$1/tmp/report.cmake" <<'EOF'
file(READ "${REPORT}" report)
string(JSON faces GET "${report}" stages mesh faces)
execute_process(COMMAND ${CMAKE_COMMAND} -E echo "${faces}")
EOF
    faces=$(chroot "$1" cmake -DREPORT="$2" -P /tmp/report.cmake) || failed "$2 is no report"
    [ "$faces" = "$3" ] || failed "the report has $faces faces where the meshes have $3"
    echo "report:  of the same $faces faces"
}

check_picture() # FILE
{
    local width height
    [ "$(head -c 8 "$1" | od -An -tx1 | tr -d ' \n')" = 89504e470d0a1a0a ] || failed "$1 is no PNG"
    read -r width height < <(od -An -tu4 --endian=big -j 16 -N 8 "$1")
    [ "$width" -ge 300 ] && [ "$height" -ge 100 ] && [ "$(stat -c %s "$1")" -ge 10000 ] ||
        failed "the picture of $width x $height pixels shows nothing"
    echo "picture: $width x $height pixels"
}

check_results() # ROOT CLONE LOG
{
    local meshes report picture faces
    meshes=$(promised "$3" meshes) report=$(promised "$3" report) picture=$(promised "$3" picture)
    [ -n "$meshes" ] && [ -n "$report" ] && [ -n "$picture" ] ||
        failed "the command does not say where meshes, report and picture lie"
    check_meshes "$1$2/$meshes" "$1$2/$(dirname "$(dirname "$meshes")")/capture/points"
    check_report "$1" "$2/$report" "$faces"
    check_picture "$1$2/$picture"
}

# In the root, as root: COMMAND.
in_root() # ROOT COMMAND
{
    local name settings=()
    for name in http_proxy https_proxy no_proxy; do
        [ -z "${!name:-}" ] || settings+=("$name=${!name}")
    done
    chroot "$1" env -i --default-signal HOME=/root PATH=/usr/sbin:/usr/bin:/sbin:/bin LANG=C.UTF-8 TERM=dumb \
        DEBIAN_FRONTEND=noninteractive "${settings[@]}" bash -e -c "$2" </dev/null
}

# The wheel first: it may not lean on what the packages bring.
use_packages() # ROOT LOG FOLDER
{
    local root=$1 log=$2 apt="apt-get install -y -qq --no-install-recommends"
    mkdir "$root/packages"
    cp "$3"/*.deb "$3"/*.whl samples/run_folder.c "$root/packages/"
    chmod -R a+rX "$root/packages"
    echo "== The wheel, in an environment of its own, without a network"
    in_root "$root" "apt-get update -qq && $apt python3-venv python3-numpy" >"$log" 2>&1 || failed "$(tail "$log")"
    in_root "$root" 'cd /packages && python3 -m venv --system-site-packages /env && /env/bin/pip install --no-index ./*.whl
        ! dpkg -l | grep -E "libopenvdb|libpcl|libtbb"
        /env/bin/neupig synth --cell 0.06 --frames 2 --points 600 -o /capture
        /env/bin/python - <<END
import pathlib, neupig
assert "/env/" in str(neupig.library_path), neupig.library_path
neupig.run("/capture/points", "/by-wheel", faces=300)
meshes = list(pathlib.Path("/by-wheel/meshes").iterdir())
assert len(meshes) == 2 and pathlib.Path("/by-wheel/done.json").exists(), meshes
print("python", neupig.__version__, len(meshes), "meshes")
END
        /env/bin/neupig view /by-wheel' || failed "the wheel does not work"
    echo "== The packages: the command"
    in_root "$root" "$apt /packages/neupig_*.deb /packages/libneupig0_*.deb" >"$log" 2>&1 || failed "$(tail "$log")"
    in_root "$root" 'cd / && neupig run capture/points -o by-command --faces 300 -q || [ $? -eq 7 ]; neupig verify by-command
        neupig view by-command && ! command -v cc' || failed "the installed command does not work"
    echo "== The packages: a program linked with pkg-config"
    carry_debs "$root/var/cache/apt/archives" "$debs"
    in_root "$root" "$apt /packages/libneupig-dev_*.deb gcc libc6-dev pkg-config" >"$log" 2>&1 || failed "$(tail "$log")"
    in_root "$root" 'cd / && cc -std=c11 -Wall -Werror packages/run_folder.c -o run_folder $(pkg-config --cflags --libs neupig)
        ldd run_folder | grep -q "/lib/.*-linux-gnu/libneupig.so.0 "
        ./run_folder capture/points by-program faces=300 || [ $? -eq 7 ]
         test -s by-program/done.json' || failed "a program does not link or run"
}

inside() # SCRATCH AS_USER WITH_TESTS PACKAGES
{
    local root=$1/root log=$1/log account home name packages=() readme command
    debs=${NEUPIG_DEBS:-/var/cache/neupig/debs}
    mkdir "$root"
    mkdir -p "$debs" 2>/dev/null || { debs=$1/debs && mkdir "$debs"; }
    [ "$2" = no ] || packages=(sudo)
    echo "== A clean machine: a new root of $(. /etc/os-release && echo "$PRETTY_NAME")"
    make_root "$root" "$log" "${packages[@]}"
    if [ -n "$4" ]; then
        use_packages "$root" "$log" "$4"
        return
    fi
    account=$(make_account "$root" "$2")
    read -r home name <<<"$account"
    put_in_clone "$root" "$home" "$name"
    readme=$root$home/neupig/README.md

    command=$(readme_command "$readme" samples/run.sh)
    echo "== The README's first command, as $name: $command"
    in_clone "$root" "$home" "$name" "$command" 2>&1 | tee "$log" || failed "the README's first command failed"
    carry_debs "$root/var/cache/apt/archives" "$debs"
    echo "== What it promises"
    check_results "$root" "$home/neupig" "$log"
    echo "== The README's other commands"
    # in a copy: what they make is not part of the clone that the tests are run in
    in_clone "$root" "$home" "$name" "cp -a . ~/reader && cd ~/reader && tests/delivery/page_commands.sh README.md" 2>&1 ||
        failed "a command of the README failed"

    [ "$3" = yes ] || return 0
    command=$(readme_command "$readme" tests/run.sh)
    echo "== All tests, as $name: $command"
    in_clone "$root" "$home" "$name" "$command" 2>&1 || failed "the tests failed"
}

if [ "${1:-}" = --inside ]; then
    shift
    inside "$@"
    exit
fi

# ---- outside: rights, and the end ----

arguments=("$@") as_user=no with_tests=no packages=""
while [ $# -gt 0 ]; do
    case $1 in
    --user) as_user=yes ;;
    --tests) with_tests=yes ;;
    --packages)
        packages=$(realpath -e "${2:-}") || exit 2
        shift
        ;;
    *)
        echo "usage: tests/clean_machine.sh [--user] [--tests] [--packages FOLDER]" >&2
        exit 2
        ;;
    esac
    shift
done

if [ "$(id -u)" -ne 0 ]; then
    sudo -n true 2>/dev/null || cannot "it takes root, or sudo that asks for no password"
    exec sudo -n env http_proxy="${http_proxy:-}" https_proxy="${https_proxy:-}" no_proxy="${no_proxy:-}" \
        TMPDIR="${TMPDIR:-}" NEUPIG_DEBS="${NEUPIG_DEBS:-}" "$self" "${arguments[@]}"
fi

. samples/packages.sh
# shellcheck disable=SC2086
install_packages $packages_to_make_roots || cannot "debootstrap can't be installed"
namespace=(setpriv --pdeathsig KILL unshare --mount --pid --fork --kill-child --mount-proc)
"${namespace[@]}" true 2>/dev/null || cannot "namespaces for mounts and processes are not allowed"
git -c safe.directory="$PWD" rev-parse --verify --quiet HEAD >/dev/null || cannot "$PWD is no checkout of git"

# The mounts are the namespace's and end with it.  The root is removed by a process that waits for the end of a pipe,
# which comes whatever ends this one.
scratch=$(mktemp -d "${TMPDIR:-/var/tmp}/neupig-clean-XXXXXX")
chmod 755 "$scratch"
exec 9> >(exec setsid bash -c 'trap "" HUP INT TERM; cat >/dev/null
    for try in 1 2 3 4 5; do rm -rf "$1" 2>/dev/null && exit; sleep 1; done; rm -rf "$1"' remover "$scratch")
remover=$! inside=""

finish()
{
    [ -z "$inside" ] || kill -KILL "$inside" 2>/dev/null || true
    exec 9>&-
    wait "$remover" || true
}
trap finish EXIT
trap 'exit 129' HUP
trap 'exit 130' INT
trap 'exit 143' TERM

"${namespace[@]}" "$self" --inside "$scratch" "$as_user" "$with_tests" "$packages" 9>&- &
inside=$!
code=0
wait "$inside" || code=$?
inside=""
what="The README's commands work"
[ -z "$packages" ] || what="The packages work"
[ "$code" -ne 0 ] || echo "== $what on a clean machine ($((SECONDS / 60)) min $((SECONDS % 60)) s)."
exit "$code"

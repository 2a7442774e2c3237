# tests/clean_machine.sh: what it does where no root can be made, and that nothing of it stays behind.  (That the
# README's commands work in a root is what the script itself is for.)

setup() {
    cd "$BATS_TEST_TMPDIR" || return 1
    script="$BATS_TEST_DIRNAME/../clean_machine.sh"
    export TMPDIR="$PWD/scratch"
    mkdir scratch bin
}

# Stands for what makes the root: it mounts something there, says so and takes its time; or it fails.
fake_debootstrap() { # BODY
    printf '#!/bin/bash\nroot=$(printf "%%s\\n" "$@" | grep /root$)\n%s\n' "$1" >bin/debootstrap
    chmod +x bin/debootstrap
    export PATH="$PWD/bin:$PATH"
}

needs_namespaces() {
    [ "$(id -u)" -eq 0 ] && unshare --mount --pid --fork --mount-proc true 2>/dev/null || skip "takes root that may mount"
    for package in debootstrap git; do
        [ "$(dpkg-query -W -f='${db:Status-Status}' $package 2>/dev/null)" = installed ] || skip "takes the package $package"
    done
    git -C "$BATS_TEST_DIRNAME" -c safe.directory='*' rev-parse --quiet --verify HEAD >/dev/null || skip "takes a checkout of git"
}

is_gone() { # within ten seconds
    for ((i = 0; i < 100; i++)); do
        [ -n "$(ls scratch)" ] || return 0
        sleep 0.1
    done
    find scratch | head
    return 1
}

@test "without the rights it takes, and where debootstrap fails, it says so and ends with 77" {
    [ "$(id -u)" -eq 0 ] || skip "takes root, to take rights away"
    open=$(mktemp -d -p /tmp) # this checkout and the tests' folder may be closed to others, as /root is
    mkdir "$open/tests"
    cp "$script" "$open/tests/"
    chmod -R a+rX "$open"
    run setpriv --reuid 65534 --clear-groups env PATH=/usr/bin:/bin "$open/tests/clean_machine.sh"
    rm -rf "$open"
    echo "$output"
    [ "$status" -eq 77 ]
    [[ "$output" == *"no root can be made here"* ]]
    needs_namespaces
    fake_debootstrap 'echo "E: no such mirror"; exit 1'
    run "$script"
    echo "$output"
    [ "$status" -eq 77 ]
    [[ "$output" == *"E: no such mirror"*"no root can be made here: debootstrap failed"* ]]
    is_gone
}

@test "stopped or killed it leaves no root, no mount and no process behind" {
    needs_namespaces
    fake_debootstrap 'mkdir -p "$root/usr"; mount -t tmpfs none "$root/usr"; echo "$root" >"$TMPDIR.started"; exec sleep 4321'
    for signal in TERM HUP KILL; do
        rm -f scratch.started
        "$script" >log 2>&1 3>&- &
        pid=$!
        for ((i = 0; i < 300; i++)); do [ -s scratch.started ] || sleep 0.1; done
        cat log
        [ -d "$(cat scratch.started)/usr" ]
        [ -z "$(grep "$PWD/scratch" /proc/mounts)" ]
        kill -$signal $pid
        wait $pid || true
        is_gone
        [ -z "$(pgrep -f '^sleep 4321$')" ]
    done
}

@test "the README has both commands that it runs" {
    for name in samples/run.sh tests/run.sh; do
        grep -qE "^ *(\\$ )?$name( |\$)" "$BATS_TEST_DIRNAME/../../README.md"
    done
}

@test "the packages, installed in a clean root, work from there" {
    [ "${NEUPIG_TEST_ROOT:-}" = yes ] || skip "takes the network and 5 minutes; NEUPIG_TEST_ROOT=yes asks for it"
    needs_namespaces
    build=$(dirname "$NEUPIG")
    cpack --config "$build/CPackConfig.cmake" -G DEB -B "$PWD/packages"
    "$BATS_TEST_DIRNAME/../../tools/python/make_wheel.py" "$build" -o packages
    unset TMPDIR # a root takes more than tests' folders may hold
    run "$script" --packages packages
    echo "$output"
    [ "$status" -ne 77 ] || skip "no root can be made here"
    [ "$status" -eq 0 ]
    [[ "$output" == *"The packages work on a clean machine"* ]]
}

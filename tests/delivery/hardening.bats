# What a release build has against files of strangers, read from its binaries.

setup() {
    build=$(dirname "$NEUPIG")
    grep -q '^CMAKE_BUILD_TYPE:[A-Z]*=Release' "$build/CMakeCache.txt" || skip "no release build"
    programs=("$NEUPIG" "$build/neupig-poisson" "$build/neupig-devices")
}

has() { # FILE WHAT OPTIONS OF READELF
    readelf -W "${@:3}" "$1" | grep -q -E "$2" || { echo "$1 has no $2"; return 1; }
}

@test "addresses can't be written after the start: full RELRO, and no stack that runs" {
    for file in "${programs[@]}" "$build/libneupig.so"; do
        has "$file" GNU_RELRO --segments
        has "$file" '\((FLAGS|FLAGS_1)\).*NOW' --dynamic
        has "$file" 'GNU_STACK .* RW ' --segments
    done
}

@test "programs lie at another place in each run" {
    for file in "${programs[@]}"; do
        has "$file" 'Type: *DYN' --file-header
        has "$file" 'FLAGS_1.*PIE' --dynamic
    done
}

@test "writes past the end of an array end the program" {
    # neupig-devices has arrays in main alone, which never returns
    for file in "$NEUPIG" "$build/neupig-poisson" "$build/libneupig.so"; do has "$file" __stack_chk_fail --dyn-syms; done
    for file in "$NEUPIG" "$build/libneupig.so"; do has "$file" '__(memcpy|snprintf|read)_chk' --dyn-syms; done
}

@test "the surface's process has no calls for files, programs and the network, and limits of time and memory" {
    grep -q '^Seccomp:' /proc/self/status || skip "the kernel has no seccomp"
    mkfifo "$BATS_TEST_TMPDIR/in"
    # a request (poisson_wire.h) of 100 points that do not come: it waits for them
    "$build/neupig-poisson" <"$BATS_TEST_TMPDIR/in" >/dev/null 2>&1 3>&- &
    pid=$!
    exec 9>"$BATS_TEST_TMPDIR/in"
    python3 -c 'import struct, sys; sys.stdout.buffer.write(struct.pack("<8sQQQIf", b"NPGPOIS2", 100, 4 << 30, 60, 6, 4))' >&9
    for ((i = 0; i < 100; i++)); do ! grep -q 'Max cpu time  *60 ' "/proc/$pid/limits" || break; sleep 0.1; done
    grep 'Max cpu time  *60 *60 ' "/proc/$pid/limits"
    grep "Max address space *$((4 << 30)) " "/proc/$pid/limits"
    grep -P '^Seccomp:\t2$' "/proc/$pid/status"
    grep -P '^NoNewPrivs:\t1$' "/proc/$pid/status"
    exec 9>&-
    ! wait $pid
}

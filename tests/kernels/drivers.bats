# Drivers that end the process that asks them for their devices: a device failure, in the command and in the library.

setup() {
    cd "$BATS_TEST_TMPDIR" || return 1
    "$NEUPIG-bodies" --body bar --frames 2 --points 300 -o capture >synth.log
    small=(align=no epochs=2 width-1=32 width-2=32 faces=200 poisson-depth=5)
}

# Exit code 4 and a line with these words from all that opens a device, and nothing is killed.
expect_device_failure() { # WORDS COMMAND...
    local words=$1 status=0 call
    shift
    for call in "$NEUPIG doctor" "$NEUPIG doctor --json" "$NEUPIG run capture/points -o out --method {\"align\":false} --quiet" \
        "$NEUPIG bench --only isometry" "$(dirname "$NEUPIG")/sample_run_folder capture/points out ${small[*]}"; do
        echo "$call"
        # shellcheck disable=SC2086  # a command line
        "$@" $call >said 2>&1 && status=0 || status=$?
        cat said
        [ "$status" -eq 4 ]
        grep -q "OpenCL can't list its devices.*$words" said
    done
    [ ! -e out/done.json ]
}

@test "a driver that aborts is a device failure with its last words" {
    shim=$(dirname "$NEUPIG")/fault_shim.so
    [ -e "$shim" ] || skip "not under a sanitizer"
    expect_device_failure "signal 6 .*out of luck" env LD_PRELOAD="$shim" NPG_FAULT_DRIVER="out of luck"
}

@test "a run of aligned frames asks no driver" {
    shim=$(dirname "$NEUPIG")/fault_shim.so
    [ -e "$shim" ] || skip "not under a sanitizer"
    run env LD_PRELOAD="$shim" NPG_FAULT_DRIVER="out of luck" "$NEUPIG" run capture/points -o aligned --faces 200 \
        --method '{"poisson-depth": 4}' --quiet
    echo "$output"
    [ "$status" -eq 0 ] || [ "$status" -eq 7 ]
    [ -e aligned/done.json ]
}

@test "in a root without /sys, where PoCL aborts, the line says what is missing" {
    unshare --mount mount -t tmpfs none /sys 2>/dev/null || skip "hiding /sys takes the right to make mounts, as root has it"
    expect_device_failure "/sys is not mounted" unshare --mount sh -c 'mount -t tmpfs none /sys && exec "$@"' sh
}

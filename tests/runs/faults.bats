# What the system does to a run: memory, disk, clock, device and other processes that fail it (tests/faults.sh has
# every case; here are a few of each kind).

faults="$BATS_TEST_DIRNAME/faults.sh"

setup() {
    cd "$BATS_TEST_TMPDIR" || return 1
    shim=$(dirname "$NEUPIG")/fault_shim.so
}

# The shim can't come before a sanitizer's own library.
needs_shim() {
    [ -e "$shim" ] || skip "not under a sanitizer"
}

@test "a request for memory that fails ends with 6, and nothing partial lies under a final name" {
    "$faults" allocations 37 397 1000
}

@test "a write, a sync or a rename that fails ends with 5, and the next run goes on; short writes are no failure" {
    needs_shim
    "$faults" writes "ENOSPC EIO SYNC RENAME SHORT EINTR" 9 9 9
}

@test "8 processes at once on a cold kernel cache" {
    needs_shim # the compiler's time is the same under a sanitizer, and the cache's code is all that is tested
    "$faults" cache 1 8
}

@test "a kernel cache that others may write to is not used" {
    mkdir -m 777 -p open/neupig && mkdir temp
    XDG_CACHE_HOME="$PWD/open" TMPDIR="$PWD/temp" "$NEUPIG" doctor >log
    [ -z "$(ls open/neupig)" ]
    [ -n "$(ls "temp/neupig-$(id -u)"/*/0)" ]
}

@test "a kernel that computes wrong is named, the exit code is 4, and the next process is well" {
    needs_shim
    mkdir cache && export XDG_CACHE_HOME="$PWD/cache"
    "$NEUPIG-bodies" --body bar --frames 2 --points 300 -o capture >synth.log
    run env LD_PRELOAD="$shim" NPG_FAULT_KERNEL="sum += fabs(change)=>sum += change" "$NEUPIG" run capture/points -o out --quiet \
        --method '{"align": false, "width-1": 32, "width-2": 32, "grid-levels": 3}'
    echo "$output"
    [ "$status" -eq 4 ]
    [[ "$output" == *"computes op isometry wrong"* ]]
    [ ! -e out/done.json ]
    run env LD_PRELOAD="$shim" NPG_FAULT_KERNEL="sum += fabs(change)=>sum += change" "$NEUPIG" doctor
    [ "$status" -eq 4 ]
    [[ "$output" == *"isometry"* ]]
    "$NEUPIG" doctor >log
}

@test "a clock that jumps an hour to and fro changes nothing" {
    needs_shim
    "$NEUPIG-bodies" --body bar --frames 3 --points 400 -o capture >synth.log
    small=(--method '{"epochs": 2, "poisson-depth": 4, "window": 2, "overlap": 1}' --faces 200 --quiet
        --bars residual=100,coverage=0,flipped=100,stretched=100)
    "$NEUPIG" run capture/points -o plain "${small[@]}"
    LD_PRELOAD=$shim NPG_FAULT_CLOCK=3600 timeout 60 "$NEUPIG" run capture/points -o jumps "${small[@]}"
    diff -r plain/meshes jumps/meshes
    cmp plain/frames.jsonl jumps/frames.jsonl
    cp -r capture/points grows && : >grows/capture.end
    LD_PRELOAD=$shim NPG_FAULT_CLOCK=3600 timeout 60 "$NEUPIG" run --follow grows -o followed "${small[@]}"
    [ "$(ls followed/meshes | wc -l)" -eq 3 ]
}

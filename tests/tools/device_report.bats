# tools/device_report.sh on the processor, by PoCL: its table, and what it says where the decoder is too slow.

REPORT=$BATS_TEST_DIRNAME/../../tools/device_report.sh

@test "operations, bytes and launches stand beside the times, and a device below its data sheet is said" {
    cd "$BATS_TEST_TMPDIR"
    export FRAMES=6 POINTS=600 EPOCHS=4 RUN_OPTIONS="--faces 800"
    export BENCH_OPTIONS="--vertices 2500 --points 300 --frames 4 --repeat 1 --only mlp"
    run "$REPORT" cpu
    echo "$output"
    [ "$status" -eq 0 ]
    # 4 epochs of 6 frames: 4 (23 + 9 x 2) launches; 2216 vertices, 4 frames, 2 (40 + 512 + 7) 512 operations
    grep -qE '^\| window of 6 frames .*\| 164 \|' device_report/report.md
    grep -qE '^\| mlp_forward \| 5.074 \| .*\| - \|$' device_report/report.md
    PEAK="1e18 1e18" run "$(dirname "$REPORT")/device_expectations.py" device_report/bench.json
    [ "$status" -eq 7 ]
    [[ "$output" == *MISSES* ]]
    PEAK="1e6 1e6" run "$(dirname "$REPORT")/device_expectations.py" device_report/bench.json
    [ "$status" -eq 0 ]
    [[ "$output" == *holds* ]]
}

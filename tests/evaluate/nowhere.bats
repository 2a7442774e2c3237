# Surface where depth images show that nothing is: measured in every frame, with a bar; only where that is known.

setup_file() {
    cd "$BATS_FILE_TMPDIR"
    "$NEUPIG" synth -o capture --rig --cameras 2 --frames 3 --cycles 0.1 --width 120 --height 90 --depth-noise 1 >synth.log
    run_it plain --export obj || [ "$code" -eq 7 ] # two coarse sensors leave much to be closed
    ball capture-plain.obj >with_ball.obj
}

setup() {
    cd "$BATS_FILE_TMPDIR"
}

# A short run of the capture into OUT; $code is its exit code.
run_it() { # OUT OPTION...
    code=0
    "$NEUPIG" run capture/rig/rig.json -o "$1" --keyframe 0 --bars invented=100,unsupported=100 -q \
        --method "{\"epochs\": 10, \"poisson-depth\": 6, \"align-nodes\": ${nodes:-1600}}" "${@:2}" >"$1.log" 2>&1 || code=$?
    cp "$1"/meshes/frame_0000.obj "capture-$1.obj" 2>/dev/null || true
    return $code
}

# The mesh, and half a metre beside it an octahedron of 15 cm.
ball() { # MESH.obj
    awk '$1 == "v" { n++ } { print } END {
        split("1 0 0 -1 0 0 0 1 0 0 -1 0 0 0 1 0 0 -1", d, " ")
        for (i = 0; i < 6; i++) print "v", 0.9 + 0.15 * d[3 * i + 1], 0.9 + 0.15 * d[3 * i + 2], 0.15 * d[3 * i + 3]
        split("1 3 5 3 2 5 2 4 5 4 1 5 3 1 6 2 3 6 4 2 6 1 4 6", f, " ")
        for (i = 0; i < 8; i++) print "f", n + f[3 * i + 1], n + f[3 * i + 2], n + f[3 * i + 3]
    }' "$1"
}

# The share of each frame, one a line.
shares() { # OUT
    sed 's/.*"nowhere_share":\([^,]*\),.*/\1/' "$1/frames.jsonl"
}

@test "a body that sensors see has none" {
    shares plain | awk '{ print } $1 > 0.002 { exit 1 }'
}

@test "a ball beside it in the reference: the frame is bad, and says why" {
    nodes=10 # too few for the ball to leave the place by itself
    run_it ball --reference with_ball.obj --bars residual=100,coverage=0,invented=100,unsupported=100 || [ "$code" -eq 7 ]
    [ "$code" -eq 7 ]
    shares ball | awk '{ print } NR == 1 && ($1 < 0.01 || $1 > 0.15) { exit 1 }'
    head -n 1 ball/frames.jsonl | grep -q '"fault":"nowhere"'
    grep -q "below the bar: share of the surface where sensors saw that nothing is, in %, is [0-9.]*, the bar 1" ball.log
    run_it lenient --reference with_ball.obj --bars residual=100,coverage=0,stretched=100,invented=100,unsupported=100,lost=100,nowhere=20
    [ "$(grep -c '"good":true' lenient/frames.jsonl)" -eq 3 ]
}

@test "a ball that can leave the place is brought out of it" {
    run_it free --reference with_ball.obj --bars flipped=100,invented=100,unsupported=100 # it is turned inside out on the way
    shares free | awk '{ print } $1 > 0.01 { exit 1 }'
}

@test "half of the body in the reference: points are lost, and the frame says so" {
    half=(--bars residual=100,coverage=0,stretched=100,invented=100,unsupported=100,nowhere=100)
    awk '$1 == "v" { n++; low[n] = $3 < 0.9; print } $1 == "f" { if (low[$2 + 0] && low[$3 + 0] && low[$4 + 0]) print }' \
        capture-plain.obj >half.obj
    run_it half --reference half.obj "${half[@]}" || [ "$code" -eq 7 ]
    [ "$code" -eq 7 ]
    [ "$(grep -c '"fault":"lost"' half/frames.jsonl)" -eq 3 ]
    grep -q "below the bar: share of the points that have no surface near them, in %, is [0-9.]*, the bar 2" half.log
    grep -q '"lost_share":0' plain/frames.jsonl
}

@test "where the background was not removed, no depth says nothing" {
    run_it unknown --reference with_ball.obj --background unknown --bars flipped=100,invented=100,unsupported=100
    shares unknown | awk '{ print } $1 != 0 { exit 1 }'
}

@test "clouds without images have no such figure" {
    "$NEUPIG" synth -o clouds --frames 3 --points 500 >/dev/null
    "$NEUPIG" run clouds/points -o clouds-out -q --method '{"epochs": 5, "poisson-depth": 5}' >/dev/null 2>&1 || [ $? -eq 7 ]
    [ "$(grep -c '"nowhere_share":null,"lost_share":null' clouds-out/frames.jsonl)" -eq 3 ]
}

@test "probe says what one sensor can't show" {
    "$NEUPIG" synth -o alone --rig --cameras 1 --frames 2 --width 120 --height 90 >/dev/null
    "$NEUPIG" probe alone/rig/rig.json >probe.log || [ $? -eq 7 ]
    grep -q "^limit .*one sensor: the surface is an open shell" probe.log
    "$NEUPIG" probe capture/rig/rig.json >probe.log || [ $? -eq 7 ]
    ! grep -q "^limit" probe.log
}

# probe: what a capture holds and what a run would trip over.

setup() {
    cd "$BATS_TEST_TMPDIR" || return 1
    "$NEUPIG" synth -o s --frames 5 --points 200 >/dev/null
}

@test "a good capture has nothing to attend to" {
    run "$NEUPIG" probe s/points
    [ "$status" -eq 0 ]
    [[ "$output" == *"frames    5, ply 5; missing 0, unreadable 0"* ]]
    [[ "$output" == *"200 to 200 per frame"* && "$output" == *"in 5 of 5 frames"* ]]
    [[ "$output" == *"estimate  memory "*" disk "*" time "* ]]
    [[ "$output" != *attention* ]]
}

@test "a gap in the numbering is found" {
    rm s/points/frame_0002.ply
    run "$NEUPIG" probe s/points
    [ "$status" -eq 7 ]
    [[ "$output" == *"attention 1 frames are missing in the numbering: 2"* ]]
}

@test "a truncated frame is bad input, unless the run would go on" {
    head -c 1000 s/points/frame_0003.ply >t && mv t s/points/frame_0003.ply
    run "$NEUPIG" probe s/points
    [ "$status" -eq 3 ]
    [[ "$output" == *"unreadable 1"*"frame_0003.ply"* ]]
    run "$NEUPIG" probe s/points --keep-going
    [ "$status" -eq 7 ]
}

@test "coordinates that are not finite are counted" {
    mkdir n
    printf '0 0 0\n1 0 0\n0 1 0\n0 0 1\nnan 0 0\n0 inf 1\n' >n/f0.xyz
    printf '0 0 0\n1 0 0\n0 1 0\n0 0 1\n1 1 1\n' >n/f1.xyz
    run "$NEUPIG" probe n
    [ "$status" -eq 7 ]
    [[ "$output" == *"2 points have coordinates that are not finite"* ]]
}

@test "jumps, changes of size and thin frames are told" {
    mkdir j
    printf '0 0 0\n1 0 0\n0 1 0\n0 0 1\n1 1 1\n' >j/f0.xyz
    printf '5 0 0\n6 0 0\n5 1 0\n5 0 1\n6 1 1\n' >j/f1.xyz
    printf '5 0 0\n5.1 0 0\n5 0.1 0\n5 0 0.1\n' >j/f2.xyz
    printf '5 0 0\n5.1 0.1 0.1\n' >j/f3.xyz
    run "$NEUPIG" probe j
    [ "$status" -eq 7 ]
    [[ "$output" == *"frame 1: the box's middle jumps"* ]]
    [[ "$output" == *"frame 2: the box's diagonal changes"* ]]
    [[ "$output" == *"frame 3 has only 2 usable points"* ]]
}

@test "a frame with too few points for a run is told, and what leaves it out" {
    mkdir e
    cp s/points/frame_000[0-3].ply e
    seq 15 | awk '{ print $1, $1 ^ 2 / 15, $1 ^ 3 / 225 }' >few.xyz
    awk 'BEGIN { print "ply\nformat ascii 1.0\nelement vertex 15\nproperty float x\nproperty float y\nproperty float z\nend_header" } { print }' few.xyz >e/frame_0004.ply
    run "$NEUPIG" probe e
    [ "$status" -eq 7 ]
    [[ "$output" == *"frame 4 has only 15 usable points, fewer than 16: --keep-going skips it"* ]]
    run "$NEUPIG" run e -o e.out
    [ "$status" -eq 3 ]
    [[ "$output" == *"frame 4 ("*"15 usable points of 15, a surface takes 16"* ]]
}

@test "far from the origin the box is still right" {
    mkdir f
    seq 0 16 | awk '{ printf "%.3f %g 6\n", 1000000.001 + $1 / 16, 5 + $1 % 2 }' >f/f0.xyz
    run "$NEUPIG" probe f --json
    [ "$status" -eq 0 ]
    [[ "$output" == *"1000000.001"* && "$output" == *"1000001.001"* ]]
}

@test "frames can be chosen, and come from standard input" {
    run "$NEUPIG" probe s/points --frames 1:3
    [ "$status" -eq 0 ]
    [[ "$output" == *"frames    2, ply 2"* ]]
    run bash -c 'cat s/points/*.ply | "$NEUPIG" probe -'
    [ "$status" -eq 0 ]
    [[ "$output" == *"frames    5, stream 5"* ]]
}

@test "nothing there is bad input" {
    run "$NEUPIG" probe nowhere
    [ "$status" -eq 3 ]
    mkdir empty
    run "$NEUPIG" probe empty
    [ "$status" -eq 3 ]
}

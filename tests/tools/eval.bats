# eval: figures that can be worked out by hand.

# A unit square at a height, as OBJ: square FILE HEIGHT
square() {
    printf 'v 0 0 %s\nv 1 0 %s\nv 1 1 %s\nv 0 1 %s\nf 1 2 3\nf 1 3 4\n' "$2" "$2" "$2" "$2" >"$1"
}

setup() {
    cd "$BATS_TEST_TMPDIR" || return 1
    mkdir truth shifted
    for t in 0 1 2; do
        square truth/$t.obj 0
        square shifted/$t.obj 0.1
    done
    square shifted/0.obj 0
}

# The number after a word of the text output: figure WORD
figure() { sed -n "s/.*$1 \([0-9.e+-]*\).*/\1/p" <<<"$output" | head -n 1; }

@test "two squares at a distance" {
    run "$NEUPIG" eval shifted truth --frames 1:3
    [ "$status" -eq 0 ]
    # 0.1 / sqrt(2) diagonals; squared and x 1e5: 500, and a little for the distance between samples
    awk -v cd="$(figure CD)" -v nc="$(figure NC)" -v f="$(figure 'F-0.5%')" \
        'BEGIN { exit !(cd > 500 && cd < 501 && nc == 1 && f == 0) }'
    run "$NEUPIG" eval shifted truth --frames 1:3 --tau 0.08
    [ "$(figure F-8%)" = "1.0000" ]
}

@test "correspondence counts from the second frame and knows swapped vertices" {
    run "$NEUPIG" eval shifted truth
    [ "$(figure Corr)" = "0.07071" ]
    # the same square with two corners exchanged from the second frame on
    for t in 1 2; do printf 'v 1 0 0\nv 0 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3\nf 2 4 3\n' >shifted/$t.obj; done
    printf 'v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3\nf 2 4 3\n' >shifted/0.obj
    run "$NEUPIG" eval shifted truth
    # two of four vertices are off by 1: 0.5 / sqrt(2)
    [ "$(figure Corr)" = "0.35355" ]
}

@test "rigidity: a turn leaves nothing, a stretch does" {
    mkdir moved still
    for t in 0 1; do square still/$t.obj 0; done
    square moved/0.obj 0
    printf 'v 0 0 0\nv 0 1 0\nv -1 1 0\nv -1 0 0\nf 1 2 3\nf 1 3 4\n' >moved/1.obj # a quarter turn
    run "$NEUPIG" eval moved still
    awk -v r="$(figure rigidity)" 'BEGIN { exit !(r >= 0 && r < 1e-6) }'
    printf 'v 0 0 0\nv 2 0 0\nv 2 1 0\nv 0 1 0\nf 1 2 3\nf 1 3 4\n' >moved/1.obj # twice as long
    run "$NEUPIG" eval moved still
    # over two frames; three points (0 0, 1 0, 1 1 and 0 0, 1 1, 0 1) or all four: half of what the stretch leaves
    awk -v r="$(figure rigidity)" 'BEGIN { exit !(r > 0.1 && r < 0.5) }'
}

@test "no correspondence where the truth changes its faces" {
    printf 'v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 4\nf 2 3 4\n' >truth/2.obj
    run "$NEUPIG" eval shifted truth
    [ "$status" -eq 0 ]
    [[ "$output" != *Corr* ]]
}

@test "a cloud as truth" {
    mkdir cloud
    for t in 0 1 2; do printf '0 0 0\n1 0 0\n1 1 0\n0 1 0\n0.5 0.5 0\n' >cloud/$t.xyz; done
    run "$NEUPIG" eval truth cloud --points-only
    [ "$status" -eq 0 ]
    [[ "$output" != *NC* ]]
    # every point of the truth has a sample of the square within a hair
    awk -v cd="$(figure 'from truth')" 'BEGIN { exit !(cd < 1) }'
}

@test "JSON carries the same figures" {
    run "$NEUPIG" eval shifted truth --json --samples 5000
    [ "$status" -eq 0 ]
    [[ "$output" == *'"frames": 3'* && "$output" == *'"Corr": 0.070710'* && "$output" == *'"per_frame": ['* ]]
}

@test "folders of a run and of a capture are looked into" {
    mkdir -p out/meshes capture
    cp truth/* out/meshes
    mv truth capture/truth
    run "$NEUPIG" eval out capture
    [ "$status" -eq 0 ]
    [ "$(figure Corr)" = "0.00000" ]
}

@test "what can't be compared is bad input, and the message names it" {
    rm shifted/2.obj
    run "$NEUPIG" eval shifted truth
    [ "$status" -eq 3 ]
    [[ "$output" == *"2 meshes"*"3 frames"* ]]
    run "$NEUPIG" eval nowhere truth
    [ "$status" -eq 3 ]
    mkdir empty
    run "$NEUPIG" eval empty truth
    [ "$status" -eq 3 ]
    printf 'v 0 0 nan\nv 1 0 0\nv 1 1 0\nf 1 2 3\n' >shifted/2.obj
    run "$NEUPIG" eval shifted truth
    [ "$status" -eq 3 ]
    [[ "$output" == *"shifted/2.obj"* ]]
    printf 'v 0 0 0\nv 0 0 0\nv 0 0 0\nf 1 2 3\n' >shifted/2.obj
    run "$NEUPIG" eval shifted truth
    [ "$status" -eq 3 ]
    [[ "$output" == *"shifted/2.obj"*"no area"* ]]
    run "$NEUPIG" eval truth truth --frames 5:9
    [ "$status" -eq 2 ]
}

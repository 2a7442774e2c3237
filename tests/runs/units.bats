# Units: what a capture is measured in changes nothing, from 1e-13 to 1e12 a side; what is beyond is refused at once.

setup() {
    cd "$BATS_TEST_TMPDIR" || return 1
    small=(--method '{"epochs": 2, "poisson-depth": 4}' --faces 300 --quiet
        --bars residual=100,coverage=0,flipped=100,stretched=100)
}

# An ellipsoid that grows and turns, 3 frames of 700 points, all multiplied by UNIT.
make_capture() { # FOLDER UNIT
    mkdir -p "$1"
    for frame in 0 1 2; do
        awk -v unit="$2" -v t="$frame" 'BEGIN {
            for (i = 0; i < 700; i++) {
                z = 1 - (2 * i + 1) / 700; r = sqrt(1 - z * z); a = 2.399963 * i + 0.1 * t
                printf "%.17g %.17g %.17g\n", unit * r * cos(a) * (1 + 0.1 * t), unit * r * sin(a), unit * 1.5 * z
            } }' >"$1/frame_000$frame.xyz"
    done
}

@test "a capture of another unit gives the same bytes in every format, where the unit is a power of two" {
    make_capture one 1
    make_capture tiny "$(awk 'BEGIN { printf "%.17g", 2 ^ -39 }')"
    make_capture large "$(awk 'BEGIN { printf "%.17g", 2 ^ 38 }')"
    forms=(--export "ply,obj,pc2,mdd,glb,usda,npz,vdb")
    "$NEUPIG" run one -o one.out "${small[@]}" "${forms[@]}"
    "$NEUPIG" run tiny -o tiny.out "${small[@]}" "${forms[@]}" --scale 549755813888
    "$NEUPIG" run large -o large.out "${small[@]}" "${forms[@]}" --scale 3.637978807091713e-12
    for name in meshes obj volumes reference.ply motion.pc2 motion.mdd motion.glb motion.usda motion.npz; do
        diff -r "one.out/$name" "tiny.out/$name"
        diff -r "one.out/$name" "large.out/$name"
    done
    "$NEUPIG" run tiny -o tiny.grids "${small[@]}" --method '{"align": false, "width-1": 32, "width-2": 32}' --export vdb --scale 549755813888
    [ -s tiny.grids/job/window_000000.vdb ]
}

@test "a capture of 1e-12 units is written as it is; a format that can't hold it says so before the fit" {
    make_capture tiny 1e-12
    "$NEUPIG" run tiny -o out "${small[@]}" --export ply,obj,pc2,mdd,glb,usda,npz
    [ "$(find out/meshes -name '*.ply' | wc -l)" -eq 3 ]
    "$NEUPIG" eval out/meshes out/meshes >same
    run "$NEUPIG" run tiny -o volumes "${small[@]}" --export vdb
    echo "$output"
    [ "$status" -eq 2 ]
    [[ "$output" == *"vdb can't hold the capture"*"scale"* ]]
    [ ! -e volumes/job/window_000000.vdb ]
}

@test "points of 1e-30 and 1e30 units, or all in one place, are bad input before the fit" {
    refused() { # UNIT WORDS
        rm -rf in out
        make_capture in "$1"
        run "$NEUPIG" run in -o out "${small[@]}"
        echo "$output"
        [ "$status" -eq 3 ]
        [[ "$output" == *"$2"* ]]
        [ ! -e out/job/window_000000.vdb ] && [ ! -e out/done.json ]
    }
    refused 1e-30 "the longest side of the box of all points is 2.99571e-30; it must be from 1e-13 to 1e+12"
    refused 9e11 "in/frame_0000.xyz: 440 of 700 points lie farther than 1e+12 away: another unit, or bytes in the wrong order?"
    refused 1e30 "in/frame_0000.xyz: 700 of 700 points lie farther than 1e+12 away: another unit, or bytes in the wrong order?"
    refused 0 "frame_0000.xyz): 1 usable points of 700, a surface takes 16"
    make_capture probed 1e-30
    run "$NEUPIG" probe probed
    echo "$output"
    [ "$status" -eq 7 ]
    [[ "$output" == *"attention the longest side of the box of all points is"* ]]
}

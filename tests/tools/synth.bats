# synth: captures with exact ground truth.

setup() { cd "$BATS_TEST_TMPDIR" || return 1; }

@test "the same options and seed give the same bytes, another seed other points" {
    "$NEUPIG" synth -o a --frames 2 --points 300 --noise 0.2 --outliers 3 --holes 2 --vary
    "$NEUPIG" synth -o b --frames 2 --points 300 --noise 0.2 --outliers 3 --holes 2 --vary
    "$NEUPIG" synth -o c --frames 2 --points 300 --noise 0.2 --outliers 3 --holes 2 --vary --seed 1
    diff -r a b
    diff -r a/truth c/truth
    run diff -r a/points c/points
    [ "$status" -eq 1 ]
}

@test "truth keeps its faces while the body moves" {
    for body in walker bar; do
        "$NEUPIG-bodies" -o $body --body $body --frames 4 --points 100
        run "$NEUPIG" eval $body/truth $body/truth --samples 2000
        [ "$status" -eq 0 ]
        [[ "$output" == *"Corr 0.00000"*"constant topology yes"* ]]
        run cmp $body/truth/frame_0000.ply $body/truth/frame_0001.ply
        [ "$status" -eq 1 ]
    done
}

@test "points lie on the truth, but for noise and outliers" {
    "$NEUPIG" synth -o clean --frames 2 --points 2000
    "$NEUPIG" synth -o noisy --frames 2 --points 2000 --noise 1 --outliers 5
    clean=$("$NEUPIG" eval clean/truth clean/points --points-only | sed 's/.*from truth \([0-9.]*\).*/\1/;q')
    noisy=$("$NEUPIG" eval noisy/truth noisy/points --points-only | sed 's/.*from truth \([0-9.]*\).*/\1/;q')
    # 100000 samples are about 1e-3 diagonals apart: a point on the surface is nearer than that to one of them.
    awk -v clean="$clean" -v noisy="$noisy" 'BEGIN { exit !(clean < 0.5 && noisy > 5) }'
}

@test "counts, normals and formats are as asked" {
    "$NEUPIG" synth -o a --frames 1 --points 123
    grep -qa "element vertex 123" a/points/frame_0000.ply
    grep -qa "property float nx" a/points/frame_0000.ply
    "$NEUPIG" synth -o b --frames 1 --points 123 --no-normals --format obj
    [ "$(grep -c '^v ' b/points/frame_0000.obj)" -eq 123 ]
    [ "$(grep -c '^vn ' b/points/frame_0000.obj)" -eq 0 ]
    grep -q '^f ' b/truth/frame_0000.obj
    "$NEUPIG" synth -o c --frames 3 --points 1000 --vary
    counts=$(for f in c/points/*; do grep -a "element vertex" "$f"; done | sort -u | wc -l)
    [ "$counts" -gt 1 ]
}

@test "cameras see one side each" {
    "$NEUPIG-bodies" -o one --body bar --frames 1 --points 2000 --cameras 1 --width 64
    "$NEUPIG-bodies" -o six --body bar --frames 1 --points 2000 --cameras 6 --width 64
    one=$("$NEUPIG" eval one/truth one/points --points-only | sed 's/.*to truth \([0-9.]*\).*/\1/;q')
    six=$("$NEUPIG" eval six/truth six/points --points-only | sed 's/.*to truth \([0-9.]*\).*/\1/;q')
    awk -v one="$one" -v six="$six" 'BEGIN { exit !(one > 3 * six) }'
}

@test "a folder that can't be made is a disk failure" {
    touch file
    run "$NEUPIG" synth -o file/out
    [ "$status" -eq 5 ]
    run "$NEUPIG" synth
    [ "$status" -eq 2 ]
}

@test "bodies that change do so at their frame and not else" {
    faces() { grep -a "^element face" "$1"; }
    for body in hands two; do
        "$NEUPIG-bodies" -o $body --body $body --frames 6 --change 4 --points 200 --cell 0.04 | grep -q "changes at frame 4"
        [ "$(faces $body/truth/frame_0000.ply)" = "$(faces $body/truth/frame_0003.ply)" ]
        [ "$(faces $body/truth/frame_0004.ply)" = "$(faces $body/truth/frame_0005.ply)" ]
        [ "$(faces $body/truth/frame_0003.ply)" != "$(faces $body/truth/frame_0004.ply)" ]
        "$NEUPIG" eval $body/truth $body/truth --frames 0:4 --samples 1000 | grep -q "constant topology yes"
    done
    "$NEUPIG-bodies" -o bar --body bar --frames 4 --points 200 --cell 0.06
    "$NEUPIG-bodies" -o early --body two --frames 4 --change 4 --points 200 --cell 0.06
    diff -r bar early
}

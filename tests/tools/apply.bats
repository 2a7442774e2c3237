# apply: another mesh through a finished run; in-between frames by hand-made jobs whose motion is known.

setup_file() {
    cd "$BATS_FILE_TMPDIR"
    "$NEUPIG-bodies" --body bar --frames 5 --points 1200 -o capture >synth.log
    "$NEUPIG" run capture/points -o job --keyframe 0 --method '{"reference-from": "key", "epochs": 8,
        "poisson-depth": 7}' --faces 800 \
        --quiet --bars residual=100,coverage=0 >job.log || [ $? -eq 7 ]
}

setup() {
    cd "$BATS_FILE_TMPDIR"
}

# The number after a word of what eval printed: figure WORD
figure() { sed -n "s/.*$1 \([0-9.e+-]*\).*/\1/p" <<<"$output" | head -n 1; }

# fail_with STATUS WORD ARGUMENTS...: exit code and word, and nothing that looks done.
fail_with() {
    local expected=$1 word=$2
    shift 2
    rm -rf bad-out
    run "$NEUPIG" apply "$@" -o bad-out
    echo "$output"
    [ "$status" -eq "$expected" ]
    [[ "$output" == *"$word"* ]]
    [ ! -e bad-out/done.json ]
}

# A tetrahedron with its first corner at x = $2, as $1.
tetrahedron() {
    printf 'ply\nformat ascii 1.0\nelement vertex 4\nproperty double x\nproperty double y\nproperty double z\n' >"$1"
    printf 'element face 4\nproperty list uchar int vertex_indices\nend_header\n' >>"$1"
    awk -v x="$2" 'BEGIN { print x, 0, 0; print x + 1, 0, 0; print x, 1, 0; print x, 0, 1 }' >>"$1"
    printf '3 0 2 1\n3 0 1 3\n3 0 3 2\n3 1 2 3\n' >>"$1"
}

# A finished job in folder $1 whose frame t (further arguments) is the tetrahedron at x = t * t.
hand_made() {
    local job=$1
    shift
    mkdir -p "$job/meshes"
    tetrahedron "$job/reference.ply" 0
    for t in "$@"; do
        tetrahedron "$job/meshes/frame_000$t.ply" $((t * t))
        echo "{\"index\":$t,\"number\":$t,\"file\":\"meshes/frame_000$t.ply\"}" >>"$job/frames.jsonl"
    done
    echo '{"fps": 25}' >"$job/done.json"
}

# x of the first vertex of an OBJ file
first_x() { awk '$1 == "v" { print $2 + 0; exit }' "$1"; }

@test "the reference itself is carried as the run's own meshes" {
    "$NEUPIG" apply job --mesh job/reference.ply -o same
    run "$NEUPIG" eval same job/meshes --samples 1000
    [ "$(figure Corr)" = "0.00000" ]
    grep -q '"exit_code": 0' same/done.json
    [ "$(grep -c '"xxh3"' same/done.json)" -eq 5 ]
}

@test "the true mesh of the key frame keeps its faces, starts as itself and follows like the run" {
    "$NEUPIG" apply job --mesh capture/truth/frame_0000.ply -o truth
    run "$NEUPIG" eval truth capture --frames 0:1
    awk -v f="$(figure 'F-0.5%')" 'BEGIN { exit !(f > 0.999) }'
    run "$NEUPIG" eval truth capture --samples 20000
    [[ "$output" == *"constant topology yes"* ]]
    carried=$(figure Corr)
    run "$NEUPIG" eval job capture --samples 20000
    awk -v a="$carried" -v b="$(figure Corr)" 'BEGIN { exit !(a > 0 && a < 1.1 * b) }'
}

@test "two steps a frame give 2 T - 1 files; the even ones are the frames" {
    "$NEUPIG" apply job --mesh capture/points/frame_0000.ply -o once
    "$NEUPIG" apply job --mesh capture/points/frame_0000.ply -o twice --fps-scale 2
    [ "$(ls twice | grep -c ply)" -eq 9 ]
    for t in 0 1 2 3 4; do cmp once/frame_000$t.ply twice/frame_000$((2 * t)).ply; done
    grep -q '"fps": 60' twice/done.json
    sed -n '/^element/p;/^end_header/q' twice/frame_0003.ply | cmp - <(echo "element vertex 1200")
}

# Mean correspondence error of the odd frames of $1 against the truth in $2.
odd_error() {
    "$NEUPIG" eval "$1" "$2" --samples 1000 --per-frame --json | tr -d ' \n' | tr '{' '\n' |
        sed -n 's/.*"frame":\([0-9]*\),"Corr":\([0-9.e-]*\).*/\1 \2/p' |
        awk '$1 % 2 { sum += $2; count++ } END { if (!count) exit 1; print sum / count }'
}

# Twice as many frames as the run sees: what lies between has a truth.
fine_and_coarse() {
    [ -d fine ] && return
    "$NEUPIG-bodies" --body bar --frames 17 --points 1500 -o fine >/dev/null
    mkdir coarse
    for t in 0 1 2 3 4 5 6 7 8; do cp "fine/points/frame_00$(printf %02d $((2 * t))).ply" coarse/frame_000$t.ply; done
}

between_run() {
    "$NEUPIG" run coarse -o "$1" --keyframe 4 --method '{"epochs": 20,
        "poisson-depth": 6, "window": 4, "overlap": 1}' --faces 1000 \
        --quiet --bars residual=100,coverage=0,flipped=100 "${@:2}" >"$1.log" || [ $? -eq 7 ]
}

# The midpoints of each two meshes of frames in $1 (made with two steps a frame), with the frames, in $2.
lines_of() {
    local k
    mkdir -p "$2"
    cp "$1"/frame_*[02468].obj "$2"
    for k in $(seq 1 2 15); do
        paste -d ' ' "$1/frame_$(printf %04d $((k - 1))).obj" "$1/frame_$(printf %04d $((k + 1))).obj" |
            awk '$1 == "v" { print "v", ($2 + $6) / 2, ($3 + $7) / 2, ($4 + $8) / 2 } 
                $1 == "f" { gsub(/\/[^ ]*/, ""); print $1, $2, $3, $4 }' \
                >"$2/frame_$(printf %04d "$k").obj"
    done
}

# In-between frames of run $1, made with further options: nearer the truth than lines between meshes, and no leap.
check_between() {
    local curves line
    fine_and_coarse
    between_run "$@"
    "$NEUPIG" apply "$1" --mesh "$1/reference.ply" -o "$1-curves" --fps-scale 2 --export obj
    lines_of "$1-curves" "$1-line"
    curves=$(odd_error "$1-curves" fine)
    line=$(odd_error "$1-line" fine)
    echo "curves $curves, lines $line"
    awk -v w="$curves" -v l="$line" 'BEGIN { exit !(w > 0 && w < 0.95 * l) }'
    # nothing leaps where windows meet: a step of a 16th of a frame is never much longer than those beside it
    "$NEUPIG" apply "$1" --mesh "$1/reference.ply" -o "$1-steps" --fps-scale 16 --export obj
    for step in "$1-steps"/*.obj; do grep '^v ' "$step" | awk '{ print $2, $3, $4 }' >"$step.v"; done
    for k in $(seq 0 127); do
        paste "$(printf "$1-steps/frame_%04d.obj.v" "$k")" "$(printf "$1-steps/frame_%04d.obj.v" $((k + 1)))" |
            awk '{ sum += sqrt(($1 - $4) ^ 2 + ($2 - $5) ^ 2 + ($3 - $6) ^ 2) } END { print sum / NR }'
    done >lengths
    awk '{ if (NR > 2 && last > 1.5 * $1 + 2e-5 && last > 1.5 * before + 2e-5) bad++; before = last; last = $1 }
        END { exit bad > 0 || NR != 128 }' lengths
}

@test "in-between frames by vertices are nearer the truth than lines between meshes, and nothing leaps" {
    check_between wide
}

@test "in-between frames by grids are nearer the truth than lines between meshes, and nothing leaps" {
    check_between grids --method '{"preset": "grids", "width-1": 32, "width-2": 32, "grid-levels": 3}'
    grep -q '"solver": "grids"' grids/report.json
}

@test "a mesh that is missing is named before anything is written" {
    cp -r job lacking
    rm lacking/meshes/frame_0002.ply
    fail_with 3 "lacking/meshes/frame_0002.ply is missing" lacking --mesh lacking/reference.ply --fps-scale 2
    [ -z "$(ls bad-out 2>/dev/null)" ]
}

@test "in-between frames lie on the curve through the frames, gaps or not" {
    rm -rf curve gap
    hand_made curve 0 1 2 3
    hand_made gap 0 1 3
    printf 'v 0 0 0 1 0 0\nv 1 0 0 0 1 0\nv 0 1 0 0 0 1\nvt 0 0\nvt 1 0\nvt 0 1\nf 1/1 2/2 3/3\n' >three.obj
    "$NEUPIG" apply curve --mesh three.obj -o curve-out --fps-scale 2 --prefix step
    [ "$(ls curve-out | grep -c '^step_000[0-6].obj$')" -eq 7 ]
    # t = 1.5 of t * t between slopes 2 and 4; at the ends the slope is that of one side
    [ "$(first_x curve-out/step_0003.obj)" = 2.25 ]
    [ "$(first_x curve-out/step_0001.obj)" = 0.375 ]
    [ "$(first_x curve-out/step_0006.obj)" = 9 ]
    grep -q '^vt 0 1$' curve-out/step_0004.obj
    [ "$(grep -c '^vn' curve-out/step_0004.obj)" -eq 3 ]
    grep -q '^v .* 0 1 0$' curve-out/step_0004.obj
    "$NEUPIG" apply curve --mesh three.obj -o curve-ply --export ply
    sed '/^end_header/q' curve-ply/frame_0003.ply >header
    grep -q 'property uchar red' header
    grep -q 'property float s' header
    grep -q 'element face 1' header
    "$NEUPIG" apply gap --mesh three.obj -o gap-out
    [ "$(ls gap-out | tr '\n' ' ')" = "done.json frame_0000.obj frame_0001.obj frame_0003.obj " ]
    "$NEUPIG" apply gap --mesh three.obj -o gap-all --fps-scale 2
    [ "$(ls gap-all | grep -c obj)" -eq 7 ]
}

@test "an OBJ file keeps its seams, polygons and materials" {
    rm -rf seam
    hand_made seam 0 1
    {
        printf 'mtllib a.mtl\no first\nv 0 0 0 1 0 0\nv 0.5 0 0 0 1 0\nv 0.5 0.5 0 0 0 1\nv 0 0.5 0 1 1 1\n'
        printf 'vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nvn 0 0 -1\nusemtl skin\nf 1/1/1 4/4/1 3/3/1 2/2/1\n'
        printf 'o second\nv 0 0 0.5\nvt 0.5 0.5\nf -1/-1 1/2 -4/3\nf 1//1 5//1 4//1\n'
    } >seam.obj
    "$NEUPIG" apply seam --mesh seam.obj -o seam-out
    cat seam-out/frame_0001.obj
    [ "$(grep -c '^v ' seam-out/frame_0001.obj)" -eq 5 ]
    [ "$(grep -c '^vn ' seam-out/frame_0001.obj)" -eq 5 ]
    grep -v '^v ' seam-out/frame_0001.obj | grep -v '^vn' >kept
    printf '%s\n' 'mtllib a.mtl' 'o first' 'vt 0 0' 'vt 1 0' 'vt 1 1' 'vt 0 1' 'usemtl skin' \
        'f 1/1/1 4/4/4 3/3/3 2/2/2' 'o second' 'vt 0.5 0.5' 'f -1/-1/-1 1/2/1 -4/3/-4' 'f 1//1 5//5 4//4' |
        cmp - kept
    grep -q '^v 1.5[0]* 0.5[0]* [-]*0.0* 0 0 1$' seam-out/frame_0001.obj
    # what was written is a mesh like the first, moved by 1
    "$NEUPIG" apply seam --mesh seam-out/frame_0000.obj -o seam-again
    cmp seam-out/frame_0001.obj seam-again/frame_0001.obj
}

@test "a file's own normals turn, points of any format are carried" {
    rm -rf still
    hand_made still 0
    printf '0.1 0.1 0 0 0 -1\n0.2 0.2 -0.05 0.6 0.8 0\n' >markers.xyzn
    "$NEUPIG" apply still --mesh markers.xyzn -o markers --export obj
    grep -q '^vn 0.60* 0.80* ' markers/frame_0000.obj
    ! grep -q '^f' markers/frame_0000.obj
}

@test "points far from the reference are said, and the exit code is 7" {
    rm -rf far
    hand_made far 0 1
    printf 'v 0 0 0\nv 0.2 0.2 -2\n' >stray.obj
    run "$NEUPIG" apply far --mesh stray.obj -o far-out
    echo "$output"
    [ "$status" -eq 7 ]
    [[ "$output" == *"1 of 2 points"*"point 1"*" 2 away"* ]]
    grep -q '"points_far": 1' far-out/done.json
    run "$NEUPIG" apply far --mesh stray.obj -o far-out --far 5 --overwrite
    [ "$status" -eq 0 ]
}

@test "what is no job is wrong usage, one that is not finished is bad input" {
    rm -rf open other
    mkdir -p nothing
    fail_with 2 nothing nothing --mesh three.obj
    fail_with 2 nowhere nowhere --mesh three.obj
    fail_with 2 "--mesh" job
    hand_made open 0 1
    rm open/done.json
    fail_with 3 "not finished" open --mesh open/reference.ply
    fail_with 3 nowhere.ply job --mesh nowhere.ply
    run "$NEUPIG" apply job --mesh job/reference.ply
    [ "$status" -eq 2 ]
    run "$NEUPIG" apply job --mesh job/reference.ply -o job
    [ "$status" -eq 2 ]
    grep -q '"options"' job/done.json
}

@test "a mesh of other faces, a bad point and a folder in use are refused" {
    rm -rf other used
    hand_made other 0 1
    sed 's/^3 0 2 1$/3 0 1 2/' other/reference.ply >other/meshes/frame_0001.ply
    fail_with 3 frame_0001.ply other --mesh other/reference.ply
    printf 'v 0 0 0\nv nan 0 0\n' >nan.obj
    fail_with 3 "vertex 1" job --mesh nan.obj
    mkdir used
    touch used/frame_0007.ply
    run "$NEUPIG" apply job --mesh job/reference.ply -o used
    [ "$status" -eq 2 ]
    [[ "$output" == *frame_0007.ply*overwrite* ]]
    "$NEUPIG" apply job --mesh job/reference.ply -o used --overwrite
    [ ! -e used/frame_0007.ply ]
}

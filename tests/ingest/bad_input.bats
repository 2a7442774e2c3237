# What neupig run does about captures that are damaged, odd or far away: it works, or says file, place and cause
# with the documented exit code.  (Folders, headers, frames without a surface: run.bats; lists, selections,
# standard input: input.bats; checkpoints, disks, jobs: resume.bats; sources that stop: live.bats.)

small=(--method '{"epochs": 4, "poisson-depth": 6}' --faces 600 --quiet
    --bars residual=100,coverage=0,flipped=100,stretched=100)

setup_file() {
    cd "$BATS_FILE_TMPDIR"
    "$NEUPIG-bodies" --body bar --frames 3 --points 900 --format obj --no-normals -o capture >synth.log
}

setup() {
    cd "$BATS_TEST_TMPDIR"
    points="$BATS_FILE_TMPDIR/capture/points"
}

# refused STATUS WORD ARGUMENTS...: the exit code, the word, and nothing under a final name
refused() {
    local expected=$1 word=$2
    shift 2
    rm -rf out
    run "$NEUPIG" run "$@" -o out "${small[@]}"
    echo "$output"
    [ "$status" -eq "$expected" ]
    [[ "$output" == *"$word"* ]]
    [ ! -e out/done.json ] && [ ! -e out/frames.jsonl ] && [ ! -e out/report.json ]
}

# Frames as XYZ rows moved by $2 $3 $4 into folder $1, with 4 digits behind the point.
moved() {
    mkdir -p "$1"
    for n in 0 1 2; do
        awk -v x="$2" -v y="$3" -v z="$4" '$1 == "v" { printf "%.4f %.4f %.4f\n", $2 + x, $3 + y, $4 + z }' \
            "$points/frame_000$n.obj" >"$1/frame_000$n.xyz"
    done
}

# The box of the vertices of an OBJ file, moved back by $2 $3 $4: six numbers.
box() {
    awk -v x="$2" -v y="$3" -v z="$4" '$1 == "v" {
        for (a = 1; a <= 3; a++) {
            v = $(a + 1) - (a == 1 ? x : a == 2 ? y : z)
            if (!(a in low) || v < low[a]) low[a] = v
            if (!(a in high) || v > high[a]) high[a] = v
        }
    } END { for (a = 1; a <= 3; a++) printf "%.4f %.4f ", low[a], high[a] }' "$1"
}

@test "rows with NaN and infinite coordinates are dropped, counted and said" {
    moved nan 0 0 0
    sed -i '7s/.*/nan 0 0/; 8s/.*/0 inf 0/; 9s/.*/0 0 -1e39/' nan/frame_0001.xyz
    "$NEUPIG" run nan -o out "${small[@]}"
    sed -n 2p out/frames.jsonl | grep -q '"not_finite":[23]'
    sed -n 1p out/frames.jsonl | grep -q '"not_finite":0'
}

@test "a frame of nothing but NaN is refused, or skipped on request" {
    moved nan 0 0 0
    sed -i 's/.*/nan nan nan/' nan/frame_0001.xyz
    refused 3 "nan/frame_0001.xyz" nan
    run "$NEUPIG" run nan -o kept --keep-going "${small[@]}"
    echo "$output"
    [ "$status" -eq 7 ]
    sed -n 2p kept/frames.jsonl | grep -q '"skipped":true'
}

@test "every kind of bad frame is skipped on request, and the run ends with 7" {
    moved many 0 0 0
    for n in 3 4 5 6 7; do cp many/frame_0002.xyz many/frame_000$n.xyz; done
    : >many/frame_0003.xyz
    echo "1 2 3" >many/frame_0004.xyz
    rm many/frame_0005.xyz && mkdir many/frame_0005.xyz
    rm many/frame_0006.xyz && ln -s nowhere many/frame_0006.xyz
    sed -i '5s/.*/1 2 three/' many/frame_0007.xyz
    refused 3 "missing: 5" many
    run "$NEUPIG" run many -o kept --keep-going --missing skip "${small[@]}"
    echo "$output"
    [ "$status" -eq 7 ]
    for n in 3 4 6 7; do [[ "$output" == *"frame_000$n.xyz"* ]]; done
    [ "$(grep -c '"skipped":true' kept/frames.jsonl)" -eq 5 ]
}

@test "a frame whose bytes stand in the wrong order is bad input, and never the keyframe" {
    for order in '0<' '1>' '2<'; do
        /usr/bin/python3 -c 'import random, struct, sys
print("ply\nformat binary_little_endian 1.0\nelement vertex 900\nproperty float x\nproperty float y\nproperty float z\nend_header", flush=True)
for _ in range(900):
    p = [random.gauss(0, 1) for _ in range(3)]
    sys.stdout.buffer.write(struct.pack(sys.argv[1][1] + "3f", *(c / sum(c * c for c in p) ** 0.5 for c in p)))' "$order" >"ball_${order::1}.ply"
    done
    refused 3 "ball_1.ply" .
    [[ "$output" == *"wrong order"* ]]
    refused 3 "ball_1.ply" ball_1.ply
    run "$NEUPIG" run . -o kept "${small[@]}" --keep-going
    [ "$status" -eq 7 ]
    sed -n 2p kept/frames.jsonl | grep -q '"key":false,"skipped":true'
}

@test "a file without permission is bad input" {
    moved locked 0 0 0
    chmod 000 locked/frame_0001.xyz
    if [ "$(id -u)" -ne 0 ]; then
        refused 3 "locked/frame_0001.xyz: can't be read: Permission denied" locked
        return
    fi
    command -v setpriv >/dev/null || skip "root, and no setpriv to be someone else"
    chmod 755 . .. ../.. 2>/dev/null || true
    mkdir free && chmod 777 free
    run setpriv --reuid 65534 --regid 65534 --clear-groups env HOME="$PWD/free" "$NEUPIG" run locked -o free/out "${small[@]}"
    echo "$output"
    if [[ "$output" == *"$NEUPIG"*"Permission denied"* || "$output" == *"no such file or folder"* ]]; then
        skip "nobody can't reach this folder"
    fi
    [ "$status" -eq 3 ]
    [[ "$output" == *"locked/frame_0001.xyz: can't be read: Permission denied"* ]]
    mkdir shut && chmod 555 shut
    run setpriv --reuid 65534 --regid 65534 --clear-groups env HOME="$PWD/free" "$NEUPIG" run locked/frame_0000.xyz -o shut/out "${small[@]}"
    echo "$output"
    [ "$status" -eq 5 ]
    [[ "$output" == *"shut/out"*"Permission denied"* ]]
}

@test "coordinates around a million keep their millimetres" {
    moved near 0 0 0
    moved far 1000000 -2000000 500000
    "$NEUPIG" run near -o near-out --export obj --keyframe 0 --frames 0:1 "${small[@]}"
    "$NEUPIG" run far -o far-out --export obj --keyframe 0 --frames 0:1 "${small[@]}"
    # the body is 2 wide; in floats alone it would be made of steps of 0.06 and 0.12. Its points lie 0.07 apart and differ
    # in the last of their digits, so the surfaces through them differ by up to a fifth of that, never by such a step.
    echo "$(box near-out/meshes/frame_0000.obj 0 0 0) $(box far-out/meshes/frame_0000.obj 1000000 -2000000 500000)" |
        awk '{ print; for (i = 1; i <= 6; i++) if (($i - $(i + 6)) ^ 2 > 0.03 ^ 2) exit 1 }'
    [ "$(grep -c '"good":true' far-out/frames.jsonl)" -eq 1 ]
    # the file itself has the digits: neighbours are millimetres apart, not the 6 cm that float would leave
    awk '$1 == "v" { print $2 }' far-out/meshes/frame_0000.obj | sort -u | wc -l >distinct
    [ "$(cat distinct)" -gt 100 ]
    "$NEUPIG" run far -o far-ply --frames 0:1 "${small[@]}"
    sed '/end_header/q' far-ply/reference.ply | grep -q 'property double x'
}

@test "a reference mesh that is no manifold, has a hole for a corner, or is none at all is bad input" {
    moved in 0 0 0
    printf 'v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nv 0 0 -1\nf 1 2 3\nf 1 2 4\nf 1 2 5\n' >fan.obj
    refused 3 "fan.obj" in --reference fan.obj
    [[ "$output" == *"not a manifold"* ]]
    printf 'v 0 0 0\nv 1 0 0\nv 0 nan 0\nf 1 2 3\n' >nan.obj
    refused 3 "nan.obj: vertex 2 is not finite" in --reference nan.obj
    printf 'v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 7\n' >corner.obj
    refused 3 "corner.obj: line 4: vertex 7" in --reference corner.obj
    printf 'v 0 0 0\nv 0 0 0\nv 0 0 0\nf 1 2 3\n' >point.obj
    refused 3 "point.obj: its faces have no area" in --reference point.obj
    refused 3 "in/frame_0000.xyz: a mesh must be PLY or OBJ" in --reference in/frame_0000.xyz
    refused 3 "none.obj" in --reference none.obj
}

@test "half of a body that no point saw: trimmed and said, kept and below the bar, or closed as asked for" {
    ! grep -q '^NPG_SANITIZE:STRING=.' "$(dirname "$NEUPIG")/CMakeCache.txt" || skip "about the verdict: the release build's"
    mkdir half
    for n in 0 1 2; do
        awk '$1 == "v" && $4 > 0.02 { print $2, $3, $4 }' "$points/frame_000$n.obj" >half/frame_000$n.xyz
    done
    run "$NEUPIG" run half -o trimmed --bars residual=100,lost=100,coverage=0 "${small[@]}" --sensor 0,0,10
    echo "$output"
    [ "$status" -eq 0 ]
    grep -q 'unseen in all frames, trimmed off' trimmed/report.json
    run "$NEUPIG" run half -o kept --unseen keep --bars residual=100,lost=100,coverage=0 "${small[@]}" --sensor 0,0,10
    echo "$output"
    [ "$status" -eq 7 ]
    [[ "$output" == *"surface is invented"* ]]
    grep -q '"exit_code": 7' kept/done.json
    run "$NEUPIG" run half -o closed --unseen close --bars residual=100,lost=100,coverage=0 "${small[@]}" --sensor 0,0,10
    echo "$output"
    [ "$status" -eq 0 ]
    grep -q 'a back that nobody saw closes it' closed/report.json
    grep -q '"border_edges": 0' closed/report.json
}

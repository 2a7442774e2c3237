# export: formats of a run that is done, by the verb, by a run that is asked again, of what apply carries, after append.

small=(--method '{"epochs": 10, "poisson-depth": 4, "window": 5, "overlap": 2,
                  "align-nodes": 40, "align-steps": 6, "vdb-voxel": 0.04}' --faces 400
    --bars residual=100,coverage=0,flipped=100,stretched=100,unsupported=100 --unit cm --up z --fps 24 --quiet)
forms=obj,ply,pc2,mdd,glb,glb-meshopt,vat,usda,npz,vdb

setup_file() {
    cd "$BATS_FILE_TMPDIR"
    "$NEUPIG-bodies" --body bar --frames 9 --points 400 -o capture >synth.log
    mkdir first
    cp capture/points/*_000[0-6].* first
    "$NEUPIG" run first -o before "${small[@]}" >before.log
    "$NEUPIG" run first -o at_once "${small[@]}" --export $forms >at_once.log
}

setup() {
    cd "$BATS_FILE_TMPDIR"
    rm -rf out && cp -r before out
}

# Every format of a folder is the same as of the run that made all at once.
same_as_at_once() {
    for name in motion.pc2 motion.mdd motion.glb motion_meshopt.glb motion_vat.json motion_vat_normals.png motion.usda motion.npz reference.obj obj volumes; do
        diff -r "$1/$name" at_once/$name
    done
}

@test "what is exported later has the bytes of what the run exports, and is verified" {
    run "$NEUPIG" export out --export glb,usda
    [ "$status" -eq 0 ]
    [ "$output" = "2 files more in out" ]
    "$NEUPIG" export out --export $forms
    same_as_at_once out
    [ "$("$NEUPIG" verify out)" = "out: 35 files as they were written" ]
    grep -q '"path":"motion.glb","bytes":[0-9]*,"xxh3":"[0-9a-f]*","form":"glb","first":0,"frames":7' out/done.json
    tr -d '\n ' <out/done.json | grep -q '"forms":\["ply","obj","pc2","mdd","glb","glb-meshopt","vat","usda","npz","vdb"\]'
    run "$NEUPIG" export out --export npz,glb
    [ "$output" = "out: all of it lies there already" ]
    printf X | dd of=out/motion.glb bs=1 seek=400 conv=notrunc 2>/dev/null
    run "$NEUPIG" export out --export npz,glb # what is damaged is made anew, the rest left alone
    [ "$output" = "1 files more in out" ]
    same_as_at_once out
}

@test "a run that is asked for other exports makes them, and nothing else" {
    run "$NEUPIG" run first -o out "${small[@]}" --export npz,pc2
    echo "$output"
    [ "$status" -eq 0 ]
    cmp out/motion.npz at_once/motion.npz
    cmp out/reference.obj at_once/reference.obj
    cmp out/report.json before/report.json
    [ "$("$NEUPIG" verify out)" = "out: 13 files as they were written" ]
    "$NEUPIG" export out --export mdd # whose reference.obj lies there already, for pc2
    cmp out/motion.mdd at_once/motion.mdd
    [ "$("$NEUPIG" verify out)" = "out: 14 files as they were written" ]
    run "$NEUPIG" run first -o out "${small[@]}" --export npz --seed 3
    [ "$status" -eq 2 ]
    [[ "$output" == *"holds another job: option seed"* ]]
}

@test "killed at any moment, the result is what it was" {
    for delay in 0.002 0.01 0.02 0.03 0.04 0.06; do
        "$NEUPIG" export out --export $forms >killed.log 2>&1 &
        pid=$!
        sleep $delay
        kill -KILL $pid 2>/dev/null || true
        wait $pid || true
        "$NEUPIG" verify out
    done
    "$NEUPIG" export out --export $forms
    same_as_at_once out
    "$NEUPIG" verify out
}

@test "frames that are appended are in the formats that were exported later" {
    "$NEUPIG" export out --export npz,glb
    cp capture/points/*_000[78].* first
    "$NEUPIG" append out --quiet
    rm first/*_000[78].*
    grep -q '"form":"glb","first":0,"frames":9' out/done.json
    grep -q '"form":"npz","first":0,"frames":9' out/done.json
    "$NEUPIG" export out --export mdd
    "$NEUPIG" verify out
}

@test "what can't be exported is said, and nothing changes" {
    run "$NEUPIG" export out --export fbx
    [ "$status" -eq 2 ]
    [[ "$output" == *'"fbx" is none of ply, obj'* ]]
    run "$NEUPIG" export first --export glb
    [ "$status" -eq 2 ]
    [[ "$output" == *"first is not the output folder of neupig run"* ]]
    run "$NEUPIG" export out
    [ "$status" -eq 2 ]
    rm out/meshes/frame_0003.ply
    run "$NEUPIG" export out --export glb
    [ "$status" -eq 3 ]
    [[ "$output" == *"frame_0003.ply"* ]]
    [ ! -e out/motion.glb ]
    cmp out/done.json before/done.json
    rm out/done.json
    run "$NEUPIG" export out --export glb
    [ "$status" -eq 3 ]
    [[ "$output" == *"not finished"* ]]
}

@test "a carried mesh is written in every format, as the run's own would be" {
    "$NEUPIG" apply out --mesh out/reference.ply -o carried --export $forms
    "$NEUPIG" verify carried
    for python in /usr/bin/python3 python3; do
        "$python" -c 'import numpy' 2>/dev/null && break
    done || skip "no Python with NumPy here"
    "$python" - <<'END'
import json
import numpy as np
run, carried = np.load("at_once/motion.npz"), np.load("carried/motion.npz")
assert (run["faces"] == carried["faces"]).all() and (run["index"] == carried["index"]).all()
size = np.ptp(run["vertices"].reshape(-1, 3), 0).max()
assert np.abs(run["vertices"] - carried["vertices"]).max() < 1e-5 * size
assert carried["up"] == "z" and carried["fps"] == 24 and carried["metres_per_unit"] == 0.01
glb = open("carried/motion.glb", "rb").read()
root = json.loads(glb[20:20 + int.from_bytes(glb[12:16], "little")])
assert "NORMAL" in root["meshes"][0]["primitives"][0]["attributes"]  # those of the file, turned
END
    "$NEUPIG" apply out --mesh out/reference.ply -o finer --export glb --fps-scale 3
    [ "$(cd finer && echo *)" = "done.json motion.glb" ] # no sequence that nobody asked for
    grep -q '"form":"glb","first":0,"frames":19' finer/done.json
    run "$NEUPIG" apply out --mesh out/reference.ply -o finer --export glb
    [ "$status" -eq 2 ]
    [[ "$output" == *"finer/motion.glb lies there already"* ]]
    "$NEUPIG" apply out --mesh out/reference.ply -o finer --export npz --overwrite
    [ "$(cd finer && echo *)" = "done.json motion.npz" ]
    printf '0 0 0\n0.1 0 0\n' >points.xyz
    run "$NEUPIG" apply out --mesh points.xyz -o points --export glb --far 100
    [ "$status" -eq 2 ]
    [[ "$output" == *"glb holds surfaces, and these are points without faces"* ]]
    "$NEUPIG" apply out --mesh points.xyz -o points --export npz,pc2 --far 100
}

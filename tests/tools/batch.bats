# Many captures at once: verdicts, limits, signals, manifests, the folders and configurations of the published code.

load batch_helpers

endless='"align": "no", "epochs": 1000000, "width-1": 32, "width-2": 32, "faces": 200, "poisson-depth": 4, "grid-levels": 2' # aligned frames are soon solved

# Two captures that go well, one whose second frame is cut off.
setup_file() {
    cd "$BATS_FILE_TMPDIR"
    mkdir set
    "$NEUPIG-bodies" --body bar --frames 3 --points 300 -o set/one >synth.log
    cp -r set/one set/two
    cp -r set/one/points set/broken
    truncate -s 3000 set/broken/frame_0001.ply
    echo "{\"output\": \"out\", // beside this file
        \"defaults\": {$small},
        \"captures\": [{\"input\": \"set/one\"}, {\"input\": \"set/broken\", \"name\": \"bad & <cut>\"},
                       {\"input\": \"set/two/points/frame_%04d.ply\", \"export\": \"obj\", \"bars\": \"residual=0\"}]}" >three.json
    status=0
    "$NEUPIG" batch three.json >first.table 2>first.log || status=$?
    echo $status >first.status
}

setup() {
    cd "$BATS_FILE_TMPDIR"
}

@test "one broken capture of three: the others are done, and the table says all" {
    cat first.log first.table
    [ "$(cat first.status)" -eq 1 ]
    [ -e out/one/done.json ]
    [ -e out/two/done.json ]
    [ ! -e "out/bad & <cut>/done.json" ]
    grep -Eq '^one +done +3 of 3 ' first.table
    grep -Eq '^two +partial +0 of 3 ' first.table
    grep -Eq '^bad & <cut> +bad input .*frame_0001.ply' first.table
    grep -q '1 of 3 captures are not done' first.log
    grep -q '"verdict": "bad input"' "out/bad & <cut>/verdict.json"
    grep -q '"exit_code": 3' "out/bad & <cut>/verdict.json"
    [ "$(grep -c '"verdict":' out/batch.json)" -eq 3 ]
    grep -q '"worst_frame": [012]' out/batch.json
    [ "$(grep -c '"good": [03]' out/batch.json)" -eq 2 ]
    for record in command start log end verdict; do
        grep -q "^{\"time\":\"20[^\"]*Z\",\"event\":\"$record\"" out/one/log.jsonl
    done
    [ "$(grep -vc '^{.*}$' out/one/log.jsonl)" -eq 0 ]
}

@test "what is done is left alone, what failed is tried again" {
    before=$(stat -c %Y.%Z out/*/done.json out/one/meshes/*)
    peak=$(grep peak_memory out/one/verdict.json)
    cp "out/bad & <cut>/verdict.json" verdict.before
    run "$NEUPIG" batch three.json --progress json
    echo "$output"
    [ "$status" -eq 1 ]
    [[ "$output" == *'one: was done already'*'two: warning: was done already'* ]]
    [ "$(grep -c '"event":"verdict".*"was_done":true' <<<"$output")" -eq 2 ]
    grep -q '"event":"end".*"exit_code":1' <<<"$output"
    [ "$before" = "$(stat -c %Y.%Z out/*/done.json out/one/meshes/*)" ]
    [ "$peak" = "$(grep peak_memory out/one/verdict.json)" ]
    run cmp -s verdict.before "out/bad & <cut>/verdict.json"
    [ "$status" -eq 1 ]
}

@test "with frames below the bar and nothing worse the exit code is 7; a changed option is named" {
    echo "{\"output\": \"out\", \"defaults\": {$small}, \"captures\": [{\"input\": \"set/one\"},
        {\"input\": \"set/two/points/frame_%04d.ply\", \"export\": \"obj\", \"bars\": \"residual=0\"}]}" >two.json
    run "$NEUPIG" batch two.json --jobs 2
    echo "$output"
    [ "$status" -eq 7 ]
    run "$NEUPIG" batch two.json --task-count 2
    [ "$status" -eq 0 ]
    run "$NEUPIG" batch two.json --seed 5
    echo "$output"
    [ "$status" -eq 1 ]
    [[ "$output" == *'option seed was "0" and is "5"'* ]]
    [ -e out/one/done.json ]
}

@test "bad manifests: file, place and cause" {
    check() { # EXIT WORDS TEXT
        echo "$3" >bad.json
        run "$NEUPIG" batch bad.json -o bad-out
        echo "$output"
        [ "$status" -eq "$1" ]
        [[ "$output" == *"bad.json$2"* ]]
        [ ! -e bad-out ]
    }
    check 2 ':2:1: ' $'{"captures": [\n}'
    check 2 ':1:' '{"captures": [{"input": "set/one"}], "captures": []}'
    check 2 ': not a JSON object' '[]'
    check 2 ': captures: not a list' '{}'
    check 2 ': captures: the list is empty' '{"captures": []}'
    check 2 ': epochs: a manifest has' '{"epochs": 3, "captures": []}'
    check 2 ': captures[0]: has no "input"' '{"captures": [{}]}'
    check 2 ': captures[0]: not an object' '{"captures": ["set/one"]}'
    check 2 ': captures[1].epochs: option epochs: "many" is not a whole number' \
        '{"captures": [{"input": "set/one"}, {"input": "set/two", "epochs": "many"}]}'
    check 2 ': captures[0].epoch: there is no option epoch' '{"captures": [{"input": "set/one", "epoch": 3}]}'
    check 2 ': defaults.max-time: not a number of seconds' '{"defaults": {"max-time": "1h"}, "captures": [{"input": "a"}]}'
    check 2 ': captures[1]: two captures have the name one' '{"captures": [{"input": "set/one"}, {"input": "other/one"}]}'
    check 2 ': captures[0]: the name x/../up has a slash' '{"captures": [{"input": "set/one", "name": "x/../up"}]}'
    check 2 ': captures[0]: the name .. begins' '{"captures": [{"input": "set/one", "name": ".."}]}'
    check 2 ': captures[0]: option follow is not for a batch' '{"captures": [{"input": "set/one", "follow": "set"}]}'
    check 2 ': captures[0].method: ' '{"captures": [{"input": "set/one", "method": "nowhere.json"}]}'
    run "$NEUPIG" batch nowhere.json -o bad-out
    [ "$status" -eq 3 ]
    [[ "$output" == *nowhere.json* ]]
    echo '{"captures": [{"input": "set/one"}]}' >bad.json
    run "$NEUPIG" batch bad.json
    [ "$status" -eq 2 ]
    [[ "$output" == *'no "output"'* ]]
    mkdir -p empty
    run "$NEUPIG" batch empty -o bad-out
    [ "$status" -eq 3 ]
}

@test "a capture that takes too long is stopped, one that takes too much memory ends, and no process is left" {
    echo "{\"output\": \"limits\", \"defaults\": {$endless}, \"captures\": [
        {\"input\": \"set/one\", \"name\": \"slow\", \"max-time\": 2},
        {\"input\": \"set/one\", \"name\": \"counted\", \"max-memory\": 1}]}" >limits.json
    run "$NEUPIG" batch limits.json --jobs 2
    echo "$output"
    [ "$status" -eq 1 ]
    grep -q '"verdict": "time"' limits/slow/verdict.json
    grep -q '"exit_code": 75' limits/slow/verdict.json
    grep -q 'not done after 2 s' limits/slow/verdict.json
    grep -q '"verdict": "memory"' limits/counted/verdict.json
    grep -q '"exit_code": 6' limits/counted/verdict.json
    for pid in $(sed -n 's/.*"event":"start".*"pid":\([0-9]*\).*/\1/p' limits/*/log.jsonl); do
        run kill -0 "$pid"
        [ "$status" -ne 0 ]
    done
}

@test "SIGTERM: the runs write their states, the exit code is 75, and the next start goes on" {
    "$NEUPIG-bodies" --body bar --frames 10 --points 300 -o long >synth.log
    echo "{\"output\": \"stopped\", \"defaults\": {$tiny, \"epochs\": 60, \"window\": 4, \"overlap\": 1}, \"captures\": [
        {\"input\": \"long\"}, {\"input\": \"set/one\", \"name\": \"later\"}]}" >stopped.json
    "$NEUPIG" batch stopped.json >stopped.table 2>stopped.log &
    pid=$!
    await $pid grep -q NPGREC01state stopped/long/job/store.npg
    kill -TERM $pid
    kill -TERM $pid
    status=0
    wait $pid || status=$?
    cat stopped.log
    [ "$status" -eq 75 ]
    grep -q '"verdict": "stopped"' stopped/long/verdict.json
    grep -Eq '^later +not run' stopped.table
    [ ! -e stopped/later ]
    run "$NEUPIG" batch stopped.json
    echo "$output"
    [ "$status" -eq 0 ]
    grep -q resumed_frames stopped/long/report.json
    [ -e stopped/later/done.json ]
}

@test "when the batch itself is killed its runs end" {
    echo "{\"output\": \"orphan\", \"captures\": [{\"input\": \"set/one\", $endless}]}" >orphan.json
    "$NEUPIG" batch orphan.json >orphan.log 2>&1 &
    pid=$!
    await $pid grep -q '"event":"start"' orphan/one/log.jsonl
    child=$(sed -n 's/.*"event":"start".*"pid":\([0-9]*\).*/\1/p' orphan/one/log.jsonl)
    kill -0 "$child"
    kill -9 $pid
    wait $pid || true
    for ((n = 0; n < 200; n++)); do
        kill -0 "$child" 2>/dev/null || break
        sleep 0.1
    done
    run kill -0 "$child"
    [ "$status" -ne 0 ]
}

@test "tasks split a batch so that each capture is done exactly once, and each writes the whole table" {
    for n in 1 2 3 4 5 6 7; do echo "{\"input\": \"set/one\", \"name\": \"c$n\"}"; done | paste -sd, >list
    echo "{\"output\": \"split\", \"captures\": [$(cat list)]}" >split.json
    "$NEUPIG" batch split.json --list >all
    [ "$(wc -l <all)" -eq 7 ]
    for task in 0 1 2; do "$NEUPIG" batch split.json --list --task-index $task --task-count 3; done | sort | diff - all
    run "$NEUPIG" batch split.json --list --task-index 3 --task-count 3
    [ "$status" -eq 2 ]
    rm out/batch.json
    for task in 0 1 2; do
        run "$NEUPIG" batch three.json --task-index $task --task-count 3
        echo "$output"
        [ "$status" -eq $((task == 1 ? 1 : task == 2 ? 7 : 0)) ]
        [ "$(grep -c '"verdict": "[a-z ]*"' out/batch.json)" -eq 3 ]
    done
    [ "$(grep -c '"not run"' out/batch.json)" -eq 0 ]
}

@test "the published code's folders and method configuration are understood" {
    mkdir -p ama/crane/gt ama/crane/point_clouds ama/crane/pcl_seqs ama/jump/gt
    for n in 0 1 2; do
        cp set/one/points/frame_000$n.ply ama/crane/point_clouds/000$n.ply
        cp out/two/meshes/frame_000$n.obj ama/crane/gt/000$n.obj
        cp out/two/meshes/frame_000$n.obj ama/jump/gt/000$n.obj
    done
    cat >fit.json <<'CONFIG'
{"descriptor": "surface", "time_encoding": "fourier_features2", "rotation_method": "cayley",
 "optimization": {"epochs": 2, "edgeloss": 50, "time_smoothing": "pdg", "catchup_scaling": "pdg"},
 "grid": {"base_res": 2, "increase_per_level": 3, "n_level": 2, "lr_adapt": 2.5, "local_lambda_adapt": 1.25,
          "neighbours": 3, "smoothness": 0.25, "lr": 0.004, "solver": "CG"},
 "mlp": {"hidden": 64, "layers": 4, "point_dim": 30, "time_dim": 6, "normal_dim": 1}}
CONFIG
    run "$NEUPIG" batch ama -o ama --list
    [ "$output" = $'crane\njump' ]
    small=(--faces 200 --method '{"poisson-depth": 4}' --bars residual=100,lost=100,flipped=100,stretched=100,coverage=0 --keyframe 1)
    run "$NEUPIG" batch ama -o results --method fit.json "${small[@]}" --task-count 2
    [ "$status" -eq 2 ]
    [[ "$output" == *'fit.json: '*'tools/method_json.py'* ]]
    "$BATS_TEST_DIRNAME/../../tools/method_json.py" fit.json >method.json 2>ignored
    [ "$(cat ignored)" = 'no counterpart, so without effect: rotation_method, grid.neighbours, grid.solver, mlp.layers' ]
    run "$NEUPIG" batch ama -o results --method method.json "${small[@]}" --task-count 2
    echo "$output"
    [ "$status" -eq 0 ]
    run "$NEUPIG" batch ama -o results "${small[@]}" --task-count 2 --task-index 1
    echo "$output"
    [ "$status" -eq 0 ]
    for option in '"method": "paper"' '"epochs": "2"' '"isometry": "50"' '"confidence": "cumulative"' \
        '"time-frequencies": "3"' '"grid-levels": "2"' '"lambda-growth": "1.25"' \
        '"lambda": "0.25"' '"normal-channels": "1"' '"grid-rate": "0.004' '"width-1": "64"' '"width-2": "64"'; do
        grep -q "$option" results/crane/done.json
    done
    grep -q 'point_clouds/0000.ply' results/crane/frames.jsonl
    grep -q 'gt/0000.obj' results/jump/frames.jsonl
}

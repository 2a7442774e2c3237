# tools/explore.py and plot_explore.py: a grid of two settings, stopped and gone on with, and its picture.

setup() {
    command -v python3 >/dev/null || skip "python3 is not installed"
    tools="$BATS_TEST_DIRNAME/../../tools"
    cd "$BATS_TEST_TMPDIR" || return 1
}

@test "a grid gives a line for every run, and only missing ones are made" {
    small=(-o out --synth --synth-frames 3 --synth-points 800 --vary epochs=1,3
        --options '--faces 600 --poisson-depth 4')
    run "$tools/explore.py" "${small[@]}"
    [ "$status" -eq 0 ]
    [[ "$output" == *"1/2"*"2/2"* ]]
    [[ "$output" == *"epochs=1 "* && "$output" == *"epochs=3 "* ]]
    [ "$(grep -c '"CD": [0-9]' out/results.jsonl)" -eq 2 ]
    [ -z "$(ls out/runs | grep -v log)" ]
    head -n 1 out/results.jsonl >kept.jsonl
    printf '%s\n{"capture": "wal' "$(cat kept.jsonl)" >out/results.jsonl # as a kill would leave it
    run "$tools/explore.py" "${small[@]}"
    [ "$status" -eq 0 ]
    [[ "$output" != *"1/2"* ]]
    [[ "$output" == *"2/2"* ]]
    [ "$(wc -l <out/results.jsonl)" -eq 2 ]
    [ "$(head -n 1 out/results.jsonl)" = "$(cat kept.jsonl)" ]
    "$tools/plot_explore.py" out/results.jsonl -o picture.svg --y Corr
    [ "$(grep -c '<circle cx.*<title>' picture.svg)" -eq 2 ]
    grep -q 'correspondence error' picture.svg
}

@test "what can't be read is wrong usage" {
    run "$tools/explore.py" -o out --vary epochs
    [ "$status" -ne 0 ]
    [[ "$output" == *"--vary epochs"* ]]
    echo '{}' >empty.jsonl
    run "$tools/plot_explore.py" empty.jsonl -o picture.svg
    [ "$status" -ne 0 ]
    [ ! -e picture.svg ]
}

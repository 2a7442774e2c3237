# tools/paper_tables.py: rows measured one by one, killed and resumed, and what failed shown as such.

setup_file() {
    cd "$BATS_FILE_TMPDIR" || return 1
    "$NEUPIG" synth -o bar --body bar --frames 17 --points 400 --cell 0.06 >/dev/null
    # The command, with few samples of its comparison; where FAIL is set, runs with that option fail, and where SLOW is, those
    # with that option wait to be killed.
    cat >command <<EOS
#!/bin/bash
[ "\$1" != eval ] || set -- "\$@" --samples 2000
[ -z "\$FAIL" ] || [[ "\$*" != *"\$FAIL"* ]] || { echo "no such thing" >&2; exit 4; }
[ -z "\$SLOW" ] || [[ "\$*" != *"\$SLOW"* ]] || sleep 60
exec "$NEUPIG" "\$@"
EOS
    chmod +x command
}

setup() {
    command -v python3 >/dev/null || skip "python3 is not installed"
    tables="$BATS_TEST_DIRNAME/../../tools/paper_tables.py"
    cd "$BATS_FILE_TMPDIR" || return 1
    small=(--neupig ./command --capture "bar=bar/points,bar/truth" --epochs 2
        --options '--faces 300 --poisson-depth 5 --width-1 32 --width-2 32 --bars residual=50')
}

measure() { "$tables" "${small[@]}" --file "$1.json" --work "$1" "${@:2}"; }

# How many rows of the file have figures.
count_measured() { grep -c '"CD": [0-9]' "$1.json"; }

@test "killed in the middle of a run, the same command makes what is missing and nothing twice" {
    SLOW="seed 2" "$tables" "${small[@]}" --file killed.json --work killed --only seeds 2>log &
    script=$!
    for _ in $(seq 600); do
        ! grep -q "3 of 3" log || break
        sleep 0.1
    done
    sleep 0.2
    kill -9 $script
    wait $script || true
    [ "$(count_measured killed)" -eq 2 ]
    grep '"CD"' killed.json | sed 's/,$//' >before
    run measure killed --only seeds
    echo "$output"
    [ "$status" -eq 0 ]
    [[ "$output" == *"1 of 1: "*"--seed 2"* ]]
    [ "$(count_measured killed)" -eq 3 ]
    [ "$(sed 's/,$//' killed.json | grep -cxFf before)" -eq 2 ]
    run measure killed --only seeds
    [ -z "$output" ] # nothing is left
    "$tables" "${small[@]}" --file killed.json --check
    sed -i 's/"CD": [0-9]/"CD": 9/' killed.json
    run "$tables" "${small[@]}" --file killed.json --check
    [ "$status" -eq 1 ]
}

@test "points are sampled on the truth: the same every time, as many and with as much noise as asked for" {
    measure first --only noise --at-most 3
    measure second --only noise --at-most 1
    diff -r first/made/bar-17x5000-noise0 second/made/bar-17x5000-noise0
    grep -qa "element vertex 5000" first/made/bar-17x5000-noise0/points/0016.ply
    distance() { "$NEUPIG" eval "first/made/$1/truth" "first/made/$1/points" --points-only | sed 's/.*from truth \([0-9.]*\).*/\1/;q'; }
    none=$(distance bar-17x5000-noise0)
    some=$(distance bar-17x5000-noise0.25)
    echo "$none $some"
    # Squared x 1e5: 0.25 % of the diagonal along the normal are 0.625, and the distance between samples comes on top.
    awk -v none="$none" -v some="$some" 'BEGIN { exit !(none < 0.3 && some > none + 0.4 && some < none + 0.7) }'
    grep -q '^| 0.25 % | 0.69 | 0.925 |' first.md
    grep -q '^In [0-9] of 2 comparisons as in the paper' first.md
    grep -q '^| 0.25 %, to 0 % | 1.57 |' first.md
}

@test "a run that fails is a row with its error, and the others are made" {
    run env FAIL="time-code learned" "$tables" "${small[@]}" --file failed.json --work failed --only time
    echo "$output"
    [ "$status" -eq 1 ]
    [ "$(count_measured failed)" -eq 3 ]
    grep -q '"error": "exit code 4: no such thing"' failed.json
    grep -q '^| learned .*failed: exit code 4: no such thing' failed.md
    run measure failed --only time # it is not run again unless that is asked for
    [ -z "$output" ]
    run measure failed --only time --retry
    [ "$status" -eq 0 ]
    [ "$(count_measured failed)" -eq 4 ]
    ! grep -q '"error"' failed.json
}

@test "what would be run is listed with its time, and what can't be with the reason" {
    run measure listed --list
    echo "$output"
    [ "$status" -eq 0 ]
    [[ "$output" == *"time: learned "*" s"* ]]
    [[ "$output" == *"lengths: 120 frames, joint "*"bar has 17 frames"* ]]
    [[ "$output" == *" runs to make of "*"minutes on "* ]]
    [ ! -e listed ]
    run "$tables" --capture bar=bar/points --list
    [ "$status" -ne 0 ]
    [[ "$output" == *"no truth"* ]]
}

@test "rows have the epochs, sizes and frames that they name" {
    run measure listed --capture "short=bar/points,bar/truth,1:17:2" --list --only lengths
    [[ "$output" == *"short has 8 frames"* ]]
    grep -q "late has 16 frames" <("$tables" "${small[@]}" --capture "late=bar/points,bar/truth,0:16" --list)
    measure rows --only rotation --at-most 1 --quick
    grep -q -- '--frames 0:17 --preset paper --epochs 30 --faces 2000 --rotation' rows.json
}

# A folder of unknown origin: nothing outside the job is read or written, nothing hangs.

small=(--method '{"epochs": 2, "poisson-depth": 4}' --faces 200 --quiet
    --bars residual=100,coverage=0,flipped=100,stretched=100)

setup_file() {
    cd "$BATS_FILE_TMPDIR"
    "$NEUPIG-bodies" --body bar --frames 2 --points 400 -o capture >synth.log
}

setup() {
    cd "$BATS_TEST_TMPDIR"
    cp -r "$BATS_FILE_TMPDIR/capture/points" in
    mkdir outside
    mv in/frame_0001.ply outside/frame.ply
}

# refused STATUS WORD ARGUMENTS...: in good time, with the exit code and the word; nothing that looks done
refused() {
    local expected=$1 word=$2
    shift 2
    run timeout 300 "$NEUPIG" "$@"
    echo "$output"
    [ "$status" -eq "$expected" ]
    [[ "$output" == *"$word"* ]]
    [ ! -e out/done.json ]
    [ ! -e out/meshes/frame_0000.ply ]
}

# What was outside is as it was.
untouched() {
    cmp outside/frame.ply "$BATS_FILE_TMPDIR/capture/points/frame_0001.ply"
    [ "$(ls -A outside)" = frame.ply ]
}

@test "a link out of the folder is not followed" {
    ln -s ../outside/frame.ply in/frame_0001.ply
    refused 3 "in/frame_0001.ply: leads out of in" run in -o out --confine "${small[@]}"
    touch in/capture.end
    refused 3 "in/frame_0001.ply: leads out of in" run --follow in -o out --confine "${small[@]}"
    untouched
}

@test "a link that stays in the folder is a frame as any other" {
    cp outside/frame.ply in/one.data
    ln -s one.data in/frame_0001.ply
    run timeout 300 "$NEUPIG" run in -o out --confine "${small[@]}"
    echo "$output"
    [ "$status" -eq 0 ]
    [ "$(ls out/meshes | wc -l)" -eq 2 ]
}

@test "a list that leads out of its folder is refused" {
    printf 'frame_0000.ply\n../outside/frame.ply\n' >in/list.txt
    refused 3 "leads out of in" run in/list.txt -o out --confine "${small[@]}"
    printf 'frame_0000.ply\n%s/outside/frame.ply\n' "$PWD" >in/list.txt
    refused 3 "leads out of in" run in/list.txt -o out --confine "${small[@]}"
    untouched
}

@test "a pipe in the place of a frame does not hang" {
    mkfifo in/frame_0001.ply
    refused 3 "in/frame_0001.ply: can't be read: a pipe or a device" run in -o out "${small[@]}"
    refused 3 "in/frame_0001.ply" probe in
    refused 3 "in/frame_0001.ply" render in -o out.png
    cp -r "$BATS_FILE_TMPDIR/capture/truth" truth
    rm truth/frame_0001.ply
    mkfifo truth/frame_0001.ply
    refused 3 "truth/frame_0001.ply" eval truth truth
    refused 3 "in/frame_0001.ply" run in/frame_0000.ply --reference in/frame_0001.ply -o out "${small[@]}"
    run timeout 300 "$NEUPIG" run in -o kept --keep-going "${small[@]}"
    [ "$status" -eq 7 ]
}

@test "a device in the place of a frame is refused" {
    ln -s /dev/zero in/frame_0001.ply
    refused 3 "in/frame_0001.ply: can't be read: a pipe or a device" run in -o out "${small[@]}"
}

@test "names with newlines, dashes, dots and bytes of no alphabet stay names" {
    mv in odd
    rm odd/*
    n=0
    for name in $'a\nb\e[31m 0.ply' $'a\nb\e[31m 1.ply'; do
        cp "$BATS_FILE_TMPDIR/capture/points/frame_000$n.ply" "odd/$name"
        n=$((n + 1))
    done
    run timeout 300 "$NEUPIG" run odd -o out "${small[@]}"
    echo "$output"
    [ "$status" -eq 0 ]
    [ "$(wc -l <out/frames.jsonl)" -eq 2 ]
    truncate -s 1000 "odd/$name"
    run timeout 300 "$NEUPIG" run odd -o bad "${small[@]}"
    [ "$status" -eq 3 ]
    [ "${#lines[@]}" -eq 1 ] # in one line, and without the terminal's own commands
    [[ "$output" != *$'\e'* ]]
    mkdir dashes
    cp outside/frame.ply dashes/-rf.ply
    cp outside/frame.ply dashes/--help.ply
    run timeout 300 "$NEUPIG" probe dashes --missing ignore
    [[ "$output" == *"frames    2"* ]]
    mkdir -- -in
    cp outside/frame.ply -- "-in/..frame_0.ply"
    rm -rf out
    refused 3 "no file here" run -o out "${small[@]}" -- -in
    cp outside/frame.ply -- -in/frame_0.ply
    run timeout 300 "$NEUPIG" probe -- -in
    [[ "$output" == *"frames    1"* ]]
    mkdir bytes
    cp outside/frame.ply "$(printf 'bytes/\377\376_0.ply')"
    run timeout 300 "$NEUPIG" run bytes -o strange "${small[@]}"
    [ "$status" -eq 0 ]
    [ -s strange/done.json ]
}

@test "paths of 4096 bytes and more are refused by name" {
    long=$(printf 'd%.0s' {1..250})
    deep=in
    for i in {1..17}; do deep=$deep/$long; done
    refused 3 "$long" run "$deep" -o out "${small[@]}"
    refused 3 "$long" run "$deep/frame_%04d.ply" -o out "${small[@]}"
    refused 5 "$long" run in/frame_0000.ply -o "out/$deep" "${small[@]}"
    printf '%s\n' "$deep/frame_0000.ply" >in/list.txt
    refused 3 "list.txt: line 1" run in/list.txt -o out "${small[@]}"
    refused 2 "$long" run in/frame_0000.ply -o out --method "$deep" "${small[@]}"
    (for i in {1..17}; do mkdir "$long" && cd "$long"; done && cp "$BATS_TEST_TMPDIR/outside/frame.ply" f0.ply)
    refused 3 "$long" run "$long" -o out "${small[@]}"
}

@test "links in the output folder lead nothing out" {
    for name in meshes job; do
        rm -rf out
        mkdir out
        ln -s ../outside "out/$name"
        refused 2 "out/$name is a link" run in/frame_0000.ply -o out --confine "${small[@]}"
        untouched
    done
    for name in obj volumes; do
        rm -rf out
        mkdir out
        ln -s ../outside "out/$name"
        refused 2 "out/$name is a link" run in/frame_0000.ply -o out --confine --export ply,obj,vdb "${small[@]}"
        untouched
    done
    rm -rf out
    mkdir -p out/meshes
    echo '{"selection": "", "frames": 1, "segments": [{"folder": "segment_0000", "first": 0, "last": 0}]}' >out/segments.json
    ln -s ../outside out/segment_0000
    refused 2 "out/segment_0000 is a link" run in/frame_0000.ply -o out --confine --segments auto "${small[@]}"
    untouched
    rm -rf out
    mkdir -p out/meshes
    for name in .write-test .reference.ply meshes/.frame_0000.ply; do ln -s "$PWD/outside/frame.ply" "out/$name.part"; done
    ln -s "$PWD/outside/frame.ply" out/frames.partial.jsonl
    ln -s "$PWD/outside/frame.ply" out/done.json
    run timeout 300 "$NEUPIG" run in/frame_0000.ply -o out --overwrite --restart "${small[@]}"
    echo "$output"
    untouched
}

@test "pipes in the output folder do not hang" {
    "$NEUPIG" run in/frame_0000.ply -o out "${small[@]}"
    for name in done.json job/job.json frames.jsonl job/store.npg; do
        rm -rf job
        cp -r out job
        rm -f "job/$name"
        mkfifo "job/$name"
        run timeout 300 "$NEUPIG" run in/frame_0000.ply -o job "${small[@]}"
        echo "$name: $output"
        [ "$status" -ne 124 ]
        run timeout 300 "$NEUPIG" apply job --mesh outside/frame.ply -o applied
        echo "$name: $output"
        [ "$status" -ne 124 ]
        rm -rf applied
    done
}

@test "a job whose list leads out of it is refused" {
    "$NEUPIG" run in/frame_0000.ply -o out "${small[@]}"
    cp out/meshes/frame_0000.ply outside/mesh.ply
    for name in ../outside/mesh.ply "$PWD/outside/mesh.ply" meshes/../../outside/mesh.ply; do
        rm -rf job
        cp -r out job
        sed -i "s|\"file\":\"[^\"]*\"|\"file\":\"$name\"|" job/frames.jsonl
        run timeout 300 "$NEUPIG" apply job --mesh out/reference.ply -o applied
        echo "$output"
        [ "$status" -eq 3 ]
        [[ "$output" == *"$name, which is not in the job"* ]]
        sed -i "s|\"path\": *\"meshes[^\"]*\"|\"path\":\"$name\"|" job/done.json
        run timeout 300 "$NEUPIG" run in/frame_0000.ply -o job "${small[@]}"
        [ "$status" -eq 2 ]
    done
}

# night DIR OPTIONS...: a batch of the folder; its table is in $output
night() {
    run timeout 300 "$NEUPIG" batch "$1" -o results "${small[@]}" "${@:2}"
    echo "$output"
}

# held NAME WORDS: its verdict is bad input and says why, and nothing of it was written
held() {
    grep -q '"verdict": "bad input"' "results/$1/verdict.json"
    grep -q "$2" "results/$1/verdict.json"
    [ ! -e "results/$1/meshes/frame_0000.ply" ]
    [ ! -e "results/$1/done.json" ]
}

@test "a batch reads nothing that links lead out of a capture's folder, unless it is told to" {
    cp -r "$BATS_FILE_TMPDIR/capture/truth" outside/truth
    mkdir -p set/{good,frames,points,truth,only}
    cp "$BATS_FILE_TMPDIR"/capture/points/* set/good
    for name in frames points truth; do cp in/frame_0000.ply set/$name; done
    ln -s ../../outside/frame.ply set/frames/frame_0001.ply
    rm set/points/*
    ln -s ../../in set/points/points
    ln -s ../../outside/truth set/truth/truth
    ln -s ../../in set/only/anything
    ln -s ../in set/link
    ln -s good set/same
    night set
    [ "$status" -eq 1 ]
    [ "$(grep -Ec '^(good|same|truth) +done ' <<<"$output")" -eq 3 ]
    held frames 'set/frames/frame_0001.ply: leads out of .*set/frames.*--no-confine'
    held points 'set/points/points/frame_0000.ply: leads out of .*set/points'
    held only 'set/only/anything/frame_0000.ply: leads out of .*set/only'
    held link 'set/link: leads out of .*set,'
    [ "$(grep -c '"verdict": "bad input"' results/batch.json)" -eq 4 ]
    # whoever writes the manifest names the folders; what is in them is of others all the same
    echo '{"captures": [{"input": "set/link"}, {"input": "set/frames"}, {"input": "set/points", "confine": false}]}' >named.json
    rm -r results
    night named.json
    [ "$status" -eq 1 ]
    [ "$(grep -Ec '^(link|set) +done ' <<<"$output")" -eq 2 ]
    held frames 'leads out of'
    night named.json --no-confine
    [ "$status" -eq 0 ]
    [ "$(ls results/frames/meshes | wc -l)" -eq 2 ]
    cmp outside/frame.ply "$BATS_FILE_TMPDIR/capture/points/frame_0001.ply"
}

@test "a batch of folders with strange names runs them all, under names that can be printed" {
    mkdir odd
    for name in -rf $'a\nb\e[31m' $'a\tb\e[31m' "$(printf 'x%.0s' {1..250})" '<b>&'; do cp -r in "odd/$name"; done
    mkfifo odd/pipe odd/-rf/frame_0001.ply
    truncate -s 1000 odd/$'a\tb\e[31m/frame_0000.ply'
    night odd
    [ "$status" -eq 1 ]
    [[ "$output" != *$'\e'* ]]
    [ "$(grep -Ec '^(a_b_\[31m(_2)?|x{190}|_rf|<b>&)  ' <<<"$output")" -eq 5 ]
    [ "$(ls -d results/*/ | wc -l)" -eq 5 ]
    [ "$(grep -Ec ' done +1 of 1 ' <<<"$output")" -eq 3 ]
    held _rf 'a pipe or a device'
    python3 -m json.tool results/batch.json >/dev/null
    [ "$(ls)" = $'in\nodd\noutside\nresults' ]
}

# view: pages of results, also of a run that is at work.  How the page behaves in a browser: view_page.bats.

setup_file() {
    cd "$BATS_FILE_TMPDIR"
    "$NEUPIG-bodies" --body bar --frames 20 --points 600 --cell 0.06 --cycles 0.4 -o capture >synth.log
    python3 "$BATS_TEST_DIRNAME/view/made_result.py" capture made
}

setup() {
    cd "$BATS_FILE_TMPDIR"
    check="$BATS_TEST_DIRNAME/view/check_page.mjs"
}

@test "a page is one file with all meshes, within 16 bits of each frame's box, and all figures" {
    run "$NEUPIG" view made
    echo "$output"
    [ "$status" -eq 0 ]
    [[ "$output" == "made/view.html: 20 frames, up to "*" vertices, "*" MB" ]]
    node "$check" made/view.html made | tee said
    grep -q ' 600 points, seen in ' said
    grep -q '"diagonal":2.29' made/view.html # the figure's own, as all figures are in
    # nothing comes from elsewhere
    run grep -oE '(src|href)="[^"]*"' made/view.html
    [ -z "$output" ]
    "$NEUPIG" view made -o again.html
    cmp made/view.html again.html
}

@test "fewer points, fewer frames" {
    "$NEUPIG" view made -o few.html --points 50 --every 6
    node "$check" few.html made 6 | tee said
    grep -q '^5 frames, .* 50 points, ' said # 0, 6, 10 (the keyframe), 12, 18
    [ "$(stat -c %s few.html)" -lt "$(stat -c %s made/view.html)" ]
}

@test "points that the run drops are told apart, and nothing is measured from them" {
    cp -r made spoiled
    python3 - spoiled capture/points/frame_0000.ply <<'END'
import json, pathlib, struct, sys
run, points = map(pathlib.Path, sys.argv[1:])
bytes_ = points.read_bytes()
head = bytes_[:bytes_.index(b"end_header\n") + 11]
stride = (len(bytes_) - len(head)) // 600
rows = [struct.unpack_from("<3f", bytes_, len(head) + stride * i) for i in range(600)] + [(0, 5, 0), (4, 0, 0), (0, 0, -3)]
(run / "spoiled.xyz").write_text("".join("%.9g %.9g %.9g\n" % row for row in rows))
lines = (run / "frames.jsonl").read_text().splitlines()
first = json.loads(lines[0])
first["source"] = str(run / "spoiled.xyz")
(run / "frames.jsonl").write_text("\n".join([json.dumps(first)] + lines[1:]) + "\n")
END
    "$NEUPIG" view spoiled
    node "$check" spoiled/view.html spoiled 1 600 | tee said
    grep -q ' 600 points, .* 3 dropped$' said
    # a run that was told to keep them has dropped none
    sed -i 's/"bars.cover"/"outliers": "no", "bars.cover"/' spoiled/done.json
    "$NEUPIG" view spoiled
    node "$check" spoiled/view.html spoiled 1 603 | tee said
    grep -q ' 603 points, .* 0 dropped$' said
}

@test "two results in one page, with the frames of both" {
    python3 "$BATS_TEST_DIRNAME/view/made_result.py" capture other 12
    "$NEUPIG" view made other
    grep -q 'id="data-1-0-0"' compare.html
    grep -q '"name":"other"' compare.html
    node "$check" compare.html made
    run "$NEUPIG" view made other made
    [ "$status" -eq 2 ]
}

@test "names are shown, not executed" {
    name='<script>alert(1)<'
    long=$(printf 'x%.0s' $(seq 255))
    cp -r made "$name"
    cp -r made "$long"
    mkdir -p "quotes\"'&"
    cp -r made "quotes\"'&/--><img src=x onerror=alert(1)>"
    cp -r made $'bytes\xff\xfe\n'
    for folder in "$name" "$long" "quotes\"'&/--><img src=x onerror=alert(1)>" $'bytes\xff\xfe\n'; do
        "$NEUPIG" view "$folder" -o hostile.html >hostile.log
        # scripts are those of the page itself: its own, its data, its facts
        [ "$(grep -o '<script' hostile.html | wc -l)" -eq "$(grep -o '<script' made/view.html | wc -l)" ]
        run grep -F '<img src=x' hostile.html
        [ "$status" -eq 1 ]
        node "$check" hostile.html made
    done
    grep -q 'script-src .sha256-' hostile.html
}

@test "what is no result ends with its exit code and leaves no page" {
    fails() { # CODE WORDS ARGUMENTS...
        run "$NEUPIG" view "${@:3}" -o none.html
        echo "$output"
        [ "$status" -eq "$1" ]
        [[ "$output" == *"$2"* ]]
        [ ! -e none.html ]
    }
    fails 2 "nowhere" nowhere
    fails 2 "is not a folder" made/done.json
    fails 2 "is not the output folder of neupig run" capture
    mkdir -p begun/job
    fails 3 "no frame is solved yet" begun
    cp -r made cut && truncate -s 3000 cut/meshes/frame_0002.ply
    fails 3 "cut/meshes/frame_0002.ply" cut
    cp -r made gone && rm gone/meshes/frame_0002.ply
    fails 3 "frame_0002.ply" gone
    cp -r made out-of && sed -i 's|"file": "meshes/frame_0001.ply"|"file": "../made/meshes/frame_0001.ply"|' out-of/frames.jsonl
    fails 3 "which is not in it" out-of
    cp -r made twice && head -n 1 made/frames.jsonl >>twice/frames.jsonl
    fails 3 "names frame 0 twice" twice
    cp -r made torn && sed -i '4s/.*/{"index": 3/' torn/frames.jsonl
    fails 3 "torn/frames.jsonl" torn
    cp -r made others && cp capture/points/frame_0000.ply others/meshes/frame_0000.ply
    fails 3 "others/meshes/frame_0000.ply" others
    cp -r made no-reference && rm no-reference/reference.ply
    fails 3 "reference.ply" no-reference
    fails 2 "--live follows one run" --live made made
    run "$NEUPIG" view made -o nowhere/page.html
    [ "$status" -eq 5 ]
}

@test "a capture that is gone leaves the meshes, and the page says so" {
    cp -r made alone
    sed -i 's|"source": "[^"]*/|"source": "lost/|' alone/frames.jsonl
    "$NEUPIG" view alone # found in the input folder that the job names
    sed -i 's|"input": "[^"]*"|"input": "lost"|' alone/job/job.json
    run "$NEUPIG" view alone
    echo "$output"
    [ "$status" -eq 0 ]
    [[ "$output" == *"20 of 20 frames without points"* ]]
    grep -q '"no_points":' alone/view.html
}

@test "without the bundle the command says what to install" {
    mkdir -p bare/bin
    cp "$NEUPIG" bare/bin/neupig
    run bare/bin/neupig view made -o none.html
    echo "$output"
    [ "$status" -eq 1 ]
    [[ "$output" == *"Debian: nodejs and npm"* ]]
    [ ! -e none.html ]
}

@test "what npm can't fetch is said, and the build goes on; a build that insists fails" {
    root=$(dirname "$(dirname "$(dirname "$BATS_TEST_FILENAME")")")
    bundle() { # MODE
        cmake -DMODE="$1" -DNODE=node -DNPM=false -DSOURCE="$root/tools/view/web" -DWORK="$PWD/work-$1" \
            -DPAGE="$PWD/page-$1.html" -DSTAMP="$PWD/stamp-$1" -P "$root/tools/view/web/bundle.cmake"
    }
    run bundle AUTO
    echo "$output"
    [ "$status" -eq 0 ]
    [[ "$output" == *"neupig view will not work: npm can't fetch"* ]]
    [ -e stamp-AUTO ]
    [ ! -e page-AUTO.html ]
    run bundle ON
    [ "$status" -ne 0 ]
    [ ! -e stamp-ON ]
}

# A run at work: two frames are there, and its lock is held.
begin_run() { # FOLDER
    python3 "$BATS_TEST_DIRNAME/view/made_result.py" capture "$1" 6
    mv "$1/frames.jsonl" "$1/all.jsonl"
    mv "$1/done.json" "$1/done.later"
    rm "$1/report.json"
    sed -n '4p;3p' "$1/all.jsonl" >"$1/frames.partial.jsonl"
    printf '{"index": 1, "num' >>"$1/frames.partial.jsonl" # a line that is being written
    touch "$1/job/lock"
    flock "$1/job/lock" sleep 60 3>&- &
    run_pid=$!
}

end_run() { # FOLDER
    cp "$1/all.jsonl" "$1/frames.jsonl"
    cp "$1/done.later" "$1/done.json"
    pkill -P $run_pid
}

begin_view() { # FOLDER
    "$NEUPIG" view --live "$1" >view.log 2>view.err 3>&- &
    view_pid=$!
    until [ -s view.log ]; do
        kill -0 $view_pid
        sleep 0.05
    done
}

facts_of() { # PAGE: frames, and whether it loads itself again
    python3 - "$1" <<'END'
import json, re, sys
facts = json.loads(re.search('id="facts">(.*?)</script>', open(sys.argv[1]).read()).group(1))
print(sum(len(part["frames"]) for part in facts["results"][0]["parts"]), facts["live"])
END
}

@test "the page of a run at work has what is there, is written anew, touches nothing else, and ends with the run" {
    begin_run live
    find live -type f ! -name view.html -printf '%p %s %T@\n' | sort >before
    begin_view live
    [ "$(facts_of live/view.html)" = "2 True" ]
    sed -n '2p' live/all.jsonl >line
    sed -i '$d' live/frames.partial.jsonl
    cat line >>live/frames.partial.jsonl
    until [ "$(facts_of live/view.html)" = "3 True" ]; do
        kill -0 $view_pid
        sleep 0.1
    done
    find live -type f ! -name view.html ! -name frames.partial.jsonl -printf '%p %s %T@\n' | sort | diff - <(grep -v partial before)
    end_run live
    wait $view_pid
    grep -q '^live/view.html: 6 frames' view.log
    [ "$(facts_of live/view.html)" = "6 False" ]
}

@test "before a frame is solved the page waits; a run that stops before its end ends it, too" {
    begin_run stopped
    rm stopped/frames.partial.jsonl stopped/reference.ply
    begin_view stopped
    until [ -e stopped/view.html ]; do
        kill -0 $view_pid
        sleep 0.1
    done
    [ "$(facts_of stopped/view.html)" = "0 True" ]
    pkill -P $run_pid || true
    kill $run_pid || true
    status=0
    wait $view_pid || status=$?
    [ "$status" -eq 3 ]
    grep -q 'no frame is solved yet' view.err
}

@test "segments are parts of one time line" {
    mkdir parts
    python3 "$BATS_TEST_DIRNAME/view/made_result.py" capture parts/segment_0000 8
    python3 "$BATS_TEST_DIRNAME/view/made_result.py" capture parts/segment_0008 8
    sed -i 's/"number": \([0-7]\),/"number": 1\1,/' parts/segment_0008/frames.jsonl
    sed -i '1s/"held"/"shared": true, "held"/' parts/segment_0008/frames.jsonl
    printf '{"selection": "", "frames": 18, "status": "partial", "segments": [{"folder": "segment_0000", "first": 0, "last": 7}, {"folder": "segment_0008", "first": 10, "last": 17}]}' >parts/segments.json
    run "$NEUPIG" view parts
    echo "$output"
    [ "$status" -eq 0 ]
    [[ "$output" == *": 15 frames, "* ]]
    grep -q '"label":"segment_0008"' parts/view.html
    grep -q 'id="data-0-1"' parts/view.html
    sed -i 's|"segment_0008"|"../made"|' parts/segments.json
    run "$NEUPIG" view parts
    [ "$status" -eq 3 ]
}

# view, in a real browser: what the page shows and how it answers to mouse, keys and touch.

setup_file() {
    here="$BATS_TEST_DIRNAME/view"
    # Modules from npm, once per machine.
    modules=${XDG_CACHE_HOME:-$HOME/.cache}/neupig-tests/view-1
    if ! cmp -s "$here/browser/package-lock.json" "$modules/package-lock.json" || [ ! -e "$modules/complete" ]; then
        mkdir -p "$modules"
        cp "$here"/browser/package*.json "$modules"
        (cd "$modules" && timeout 300 npm ci --ignore-scripts --no-audit --no-fund)
        touch "$modules/complete"
    fi
    browser=$(command -v chromium)
    export modules browser here
    cd "$BATS_FILE_TMPDIR"
    "$NEUPIG-bodies" --body bar --frames 20 --points 600 --cell 0.06 --cycles 0.4 -o capture >synth.log
    python3 "$here/made_result.py" capture made
    "$NEUPIG" view made
}

setup() {
    cd "$BATS_FILE_TMPDIR"
}

in_browser() { # TEST ARGUMENTS...
    timeout 100 node "$here/browser_test.mjs" "$modules" "$browser" "$@"
}

@test "curve, marks and notes are those of the run, decoded positions those of its meshes" {
    in_browser figures made/view.html made
}

@test "each colour mode, shading, view and theme changes the picture; a click gives a vertex" {
    in_browser looks made/view.html
}

@test "it plays, pauses, steps, scrubs and loops, by buttons, mouse and keys" {
    in_browser plays made/view.html
}

@test "mesh, opacity, points alone, a distance, the picture as a file, frame and camera in the address" {
    in_browser tools made/view.html
}

@test "while a page loads it says how much is there, and its buttons are dead" {
    in_browser loading made/view.html
}

@test "a known frame looks as it did" {
    in_browser picture made/view.html "$here/known_frame.png"
}

@test "two results move and turn together on one time line" {
    python3 "$here/made_result.py" capture other 12
    "$NEUPIG" view made other -o both.html
    in_browser compare both.html
}

@test "at the width of a phone all is within reach" {
    in_browser phone made/view.html
}

@test "names and warnings are shown as text" {
    name='<img src=x onerror=alert(1)>"'\'
    cp -r made "$name"
    "$NEUPIG" view "$name" -o names.html
    in_browser names names.html
}

@test "a live page follows the run to its end" {
    python3 "$here/made_result.py" capture live 6
    mv live/frames.jsonl live/all.jsonl
    mv live/done.json live/done.later
    sed -n '4p;3p' live/all.jsonl >live/frames.partial.jsonl
    touch live/job/lock
    flock live/job/lock sleep 100 3>&- &
    run_pid=$!
    "$NEUPIG" view --live live >view.log 3>&- &
    view_pid=$!
    until [ -s view.log ]; do
        kill -0 $view_pid
        sleep 0.05
    done
    in_browser live live/view.html live $run_pid
    wait $view_pid
    kill $run_pid || true
}

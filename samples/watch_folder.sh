#!/bin/bash
# A watch folder: every sub-folder that appears in IN is a capture, and is run into OUT as soon as it is complete.
#
#   samples/watch_folder.sh IN OUT [OPTIONS OF neupig run...]
#
# A capture is complete when it holds a file named capture.end, or when nothing in it has changed for SETTLE seconds
# (60).  What is done, and what has failed and was not changed since, is left alone; so the script can be stopped,
# killed and started again at any time: the run at work goes on where it was.  Results: OUT/NAME with run.log.  POLL is
# the seconds between two looks (5).  Ends with 0 once a file IN/watch.end is there and all captures have been run, with
# 75 after SIGTERM or SIGINT.
#
# Whoever fills IN may be anybody: nothing that links lead out of a capture's folder is read (--confine; --no-confine
# among the OPTIONS takes it back), and a link in the place of a capture is left alone and said once.
set -euo pipefail
neupig=${NEUPIG:-neupig} settle=${SETTLE:-60} poll=${POLL:-5}
if [ $# -lt 2 ]; then
    echo "usage: $0 IN OUT [OPTIONS...]" >&2
    exit 2
fi
in=$1 out=$2
shift 2
mkdir -p "$out"

# One watcher per OUT; the lock ends with its process.
exec 9>"$out/.watch.lock"
flock -n 9 || { echo "another watcher is at work on $out" >&2; exit 2; }

run=""
stop() {
    [ -z "$run" ] || kill -TERM "$run" 2>/dev/null || true
    [ -z "$run" ] || wait "$run" || true
    exit 75
}
trap stop TERM INT

# All that is in a capture: names, sizes, times.
contents() { # CAPTURE
    find "$1" -type f -printf '%P %s %T@\n' | LC_ALL=C sort
}

is_complete() { # CAPTURE
    [ -e "$1/capture.end" ] && return
    [ -n "$(find "$1" -type f -print -quit)" ] && [ -z "$(find "$1" -newermt "-$settle seconds" -print -quit)" ]
}

is_over() { # CAPTURE RESULT: done, or failed with just these files
    [ -e "$2/done.json" ] || { [ -e "$2/failed" ] && [ "$(contents "$1")" = "$(cat "$2/failed")" ]; }
}

run_capture() { # CAPTURE RESULT OPTIONS...
    local capture=$1 result=$2 code=0
    shift 2
    mkdir -p "$result"
    rm -f "$result/failed"
    contents "$capture" >"$result/.contents"
    "$neupig" run "$capture" -o "$result" --confine --log-file "$result/log.jsonl" --quiet "$@" >"$result/run.log" 2>&1 9>&- &
    run=$!
    wait $run || code=$?
    run=""
    echo "$(date -u +%FT%TZ) $(basename "$capture"): exit code $code"
    case $code in
    0 | 7) rm -f "$result/.contents" ;;
    75) exit 75 ;; # somebody stopped it: not ours to start again at once
    *) mv "$result/.contents" "$result/failed" ;;
    esac
}

declare -A said
while true; do
    left=0
    for capture in "$in"/*/; do
        [ -d "$capture" ] || continue
        capture=${capture%/}
        if [ -L "$capture" ]; then
            [ -n "${said[$capture]:-}" ] || echo "$(date -u +%FT%TZ) $(basename "$capture"): a link, left alone"
            said[$capture]=yes
            continue
        fi
        result=$out/$(basename "$capture")
        is_over "$capture" "$result" && continue
        left=$((left + 1))
        is_complete "$capture" || continue
        run_capture "$capture" "$result" "$@"
    done
    [ $left -eq 0 ] && [ -e "$in/watch.end" ] && exit 0
    sleep "$poll" 9>&- &
    wait $! || true
done

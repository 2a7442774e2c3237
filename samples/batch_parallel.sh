#!/bin/bash
# A batch by GNU parallel (apt install parallel): one process of neupig for each capture.
#
#   samples/batch_parallel.sh MANIFEST OUT [JOBS [OPTIONS OF neupig batch...]]
#
# JOBS captures (1) are at work at a time.  Started again it does what is left: OUT/joblog says which captures have
# failed or were stopped, and a run that was stopped goes on where it was.  Ends as neupig batch does: 0 all are done,
# 7 some with frames below the bar, 1 some are not done, 75 stopped by SIGTERM or SIGINT.
set -euo pipefail
neupig=${NEUPIG:-neupig}
if [ $# -lt 2 ]; then
    echo "usage: $0 MANIFEST OUT [JOBS [OPTIONS...]]" >&2
    exit 2
fi
manifest=$1 out=$2 jobs=${3:-1}
shift $(($# < 3 ? 2 : 3))

names=$("$neupig" batch "$manifest" -o "$out" --list)
count=$(wc -l <<<"$names")
mkdir -p "$out"

# The second SIGTERM makes parallel pass it on to the runs, which write their states and end.
stop() {
    stopped=yes
    kill -TERM $parallel 2>/dev/null || return 0
    sleep 0.2
    kill -TERM $parallel 2>/dev/null || true
}

stopped=no
seq 0 $((count - 1)) | parallel --quote --jobs "$jobs" --joblog "$out/joblog" --resume-failed --termseq TERM,20000,KILL,100 \
    "$neupig" batch "$manifest" -o "$out" --task-index {} --task-count "$count" --quiet "$@" >/dev/null &
parallel=$!
trap stop TERM INT
while kill -0 $parallel 2>/dev/null; do wait $parallel || true; done
[ $stopped = no ] || exit 75

# parallel counts processes that did not end with 0; what became of the captures stands in their folders.
"$neupig" batch "$manifest" -o "$out" --report

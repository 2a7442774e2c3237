# What a job's store holds (pipeline/store.h), from outside.  A record's head: "NPGREC01", its kind, its index.

# How many records of kind $2 (state) the job in folder $1 has, those that were forgotten included.
records() {
    cat "$1"/job/store.* 2>/dev/null | grep -ao "NPGREC01${2:-state}" | wc -l
}

# Where the last record of kind $2 begins in file $1.
last_record() {
    grep -abo "NPGREC01$2" "$1" 2>/dev/null | tail -1 | cut -d: -f1
}

# The number of the newest state of the job in folder $1; nothing where there is none.
newest_state() {
    local store=$1/job/store.npg at
    at=$(last_record "$store" state)
    [ -z "$at" ] || od -An -td8 -j $((at + 16)) -N 8 "$store" | tr -d ' '
}

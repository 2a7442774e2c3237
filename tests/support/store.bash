# What a job's store holds (pipeline/store.h), from outside.  A record's head: "NPGREC01", its kind, its index.

# How many records of kind $2 (state) the job in folder $1 has, those that were forgotten included.
records() {
    cat "$1"/job/store.* 2>/dev/null | grep -ao "NPGREC01${2:-state}" | wc -l
}

# Where the last record of kind $2 begins in file $1.
last_record() {
    grep -abo "NPGREC01$2" "$1" 2>/dev/null | tail -1 | cut -d: -f1
}

# A command that gets signal $1 (KILL, TERM) behind record $2 that it writes (state:2, inside:-1), or a later one of that
# kind; then the command.  killed_status: how it ended.
signalled_at() {
    local order
    order=$(kill -l "$1"):$2
    shift 2
    killed_status=0
    NPG_FAULT_SIGNAL=$order LD_PRELOAD=$(dirname "$NEUPIG")/fault_shim.so "$@" || killed_status=$?
}

# One that is killed there; fails where it ended before.
killed_at() {
    signalled_at KILL "$@"
    [ "$killed_status" -eq 137 ]
}

# Recipes for many captures: GNU parallel, a watch folder, a real Slurm on this machine.

load batch_helpers

long='"epochs": 80, "window": 5, "overlap": 2'
samples=$BATS_TEST_DIRNAME/../../samples

setup_file() {
    cd "$BATS_FILE_TMPDIR"
    "$NEUPIG-bodies" --body bar --frames 3 --points 300 -o short >synth.log
    "$NEUPIG-bodies" --body bar --frames 91 --points 400 -o long >synth.log
    cp -r short/points broken
    truncate -s 3000 broken/frame_0001.ply
}

setup() {
    cd "$BATS_FILE_TMPDIR"
    export NEUPIG
}

@test "GNU parallel: what failed is done again, what is done is not" {
    command -v parallel || skip "parallel is not installed"
    cp -r broken second
    echo "{\"defaults\": {$small}, \"captures\": [{\"input\": \"short\"}, {\"input\": \"second\"}]}" >parallel.json
    run "$samples/batch_parallel.sh" parallel.json parallel-out 2
    echo "$output"
    [ "$status" -eq 1 ]
    [[ "$output" == *'second '*'bad input '* ]]
    before=$(stat -c %Y.%Z parallel-out/short/done.json parallel-out/short/verdict.json)
    rm -r second
    cp -r short/points second
    run "$samples/batch_parallel.sh" parallel.json parallel-out 2
    echo "$output"
    [ "$status" -eq 0 ]
    [ "$before" = "$(stat -c %Y.%Z parallel-out/short/done.json parallel-out/short/verdict.json)" ]
    grep -q '"exit_code": 0' parallel-out/batch.json
}

@test "GNU parallel: SIGTERM reaches the runs" {
    command -v parallel || skip "parallel is not installed"
    echo "{\"defaults\": {$tiny, \"epochs\": 1000000}, \"captures\": [{\"input\": \"short\"}, {\"input\": \"long\"}]}" >endless.json
    "$samples/batch_parallel.sh" endless.json endless-out 1 >endless.log 2>&1 &
    pid=$!
    await $pid grep -q '"event":"start"' endless-out/short/log.jsonl
    kill -TERM $pid
    status=0
    wait $pid || status=$?
    cat endless.log
    [ "$status" -eq 75 ]
    grep -q '"verdict": "stopped"' endless-out/short/verdict.json
    [ ! -e endless-out/long ]
}

@test "a watch folder runs what is complete, once, and goes on after it was stopped" {
    mkdir watched
    ln -s ../short watched/linked
    watch() { SETTLE=2 POLL=0.2 "$samples/watch_folder.sh" watched watch-out --method "{$tiny, $long}" >>watch.log 2>&1; }
    watch &
    pid=$!
    cp -r short watched/one
    mkdir watched/two
    cp -r broken watched/bad
    touch watched/one/capture.end watched/bad/capture.end
    await $pid ls watch-out/one/done.json watch-out/bad/failed
    cp -r short/points watched/two/points # no end file: complete when it has settled
    await $pid ls watch-out/two/done.json
    cp -r long watched/long
    touch watched/long/capture.end
    await $pid grep -q NPGREC01state watch-out/long/job/store.npg
    kill -TERM "$(pgrep -P $pid -f watch_folder.sh || echo $pid)"
    wait $pid || true
    cat watch.log
    [ ! -e watch-out/long/done.json ]
    touch watched/watch.end
    before=$(stat -c %Y.%Z watch-out/one/done.json)
    run watch
    cat watch.log
    [ "$status" -eq 0 ]
    grep -q resumed_frames watch-out/long/report.json
    [ "$before" = "$(stat -c %Y.%Z watch-out/one/done.json)" ]
    [ "$(grep -c 'bad: exit code 3' watch.log)" -eq 1 ]
    cp -r short/points/frame_0001.ply watched/bad
    run watch
    cat watch.log
    [ "$status" -eq 0 ]
    grep -q 'bad: exit code 0' watch.log
    [ "$(grep -c 'linked: a link, left alone' watch.log)" -eq 3 ] # once by each watcher
    [ ! -e watch-out/linked ]
}

# A Slurm of its own in $1: one machine, this one.
start_slurm() {
    local folder=$1 name port
    name=$(hostname -s) port=$((20000 + $$ % 20000))
    mkdir -p "$folder/state" "$folder/spool"
    head -c 128 /dev/urandom >"$folder/key"
    chmod 600 "$folder/key"
    munged --key-file="$folder/key" --socket="$folder/munge" --pid-file="$folder/munged.pid" \
        --log-file="$folder/munged.log" --seed-file="$folder/seed" 3>&- || return 1
    cat >"$folder/slurm.conf" <<CONFIG
ClusterName=neupig
SlurmctldHost=$name(127.0.0.1)
SlurmUser=root
SlurmdUser=root
AuthType=auth/munge
AuthInfo=cred_expire=5,socket=$folder/munge
StateSaveLocation=$folder/state
SlurmdSpoolDir=$folder/spool
SlurmctldPidFile=$folder/slurmctld.pid
SlurmdPidFile=$folder/slurmd.pid
SlurmctldLogFile=$folder/slurmctld.log
SlurmdLogFile=$folder/slurmd.log
SlurmctldPort=$port
SlurmdPort=$((port + 1))
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
JobAcctGatherType=jobacct_gather/none
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU
SwitchType=switch/none
MpiDefault=none
ReturnToService=2
KillWait=30
NodeName=$name NodeAddr=127.0.0.1 CPUs=2 State=UNKNOWN
PartitionName=all Nodes=ALL Default=YES MaxTime=INFINITE State=UP
SlurmdParameters=config_overrides
CONFIG
    export SLURM_CONF=$folder/slurm.conf
    slurmctld -f "$SLURM_CONF" >"$folder/start.log" 2>&1 3>&- || return 1
    slurmd -f "$SLURM_CONF" >>"$folder/start.log" 2>&1 3>&- || return 1
    for ((n = 0; n < 150; n++)); do
        sinfo -h -o %T 2>/dev/null | grep -q idle && return 0
        sleep 0.2
    done
    return 1
}

teardown() {
    local daemon pid
    [ -n "${slurm:-}" ] || return 0
    if [ -n "${job:-}" ]; then
        scancel --quiet "$job" 2>/dev/null || true
        for ((n = 0; n < 400; n++)); do
            [ -n "$(squeue -h -j "$job" 2>/dev/null)" ] || break
            sleep 0.1
        done
    fi
    for daemon in slurmd slurmctld munged; do
        pid=$(cat "$slurm/$daemon.pid" 2>/dev/null) || continue
        kill "$pid" 2>/dev/null || continue
        for ((n = 0; n < 100; n++)); do
            kill -0 "$pid" 2>/dev/null || break
            sleep 0.1
        done
    done
    rm -rf "$slurm"
}

@test "a Slurm array does each capture once, and goes on after SIGTERM and after a requeue" {
    for program in munged slurmctld slurmd sbatch; do
        PATH=$PATH:/usr/sbin:/sbin command -v $program >/dev/null || skip "$program is not installed"
    done
    [ "$(id -u)" -eq 0 ] || skip "a Slurm of one's own is started as root"
    export PATH=$PATH:/usr/sbin:/sbin
    slurm=$(mktemp -d) # munged wants its socket where everybody can reach it
    chmod 755 "$slurm"
    if ! start_slurm "$slurm"; then
        tail -n 5 "$slurm"/*.log >&3
        skip "slurmctld, slurmd or munged can't start here"
    fi
    # both are at work until the last of them has begun, been stopped and been queued again, however busy the machine is
    "$NEUPIG-bodies" --body bar --frames 241 --points 400 -o longer >>synth.log
    echo "{\"output\": \"farm\", \"defaults\": {$tiny, $long}, \"captures\": [{\"input\": \"longer\", \"name\": \"a\"},
        {\"input\": \"longer\", \"name\": \"b\"}, {\"input\": \"short\", \"name\": \"c\"}]}" >farm.json
    job=$(sbatch --parsable --array=1-2 --output="$PWD/task-%a.log" "$samples/batch.sbatch" "$PWD/farm.json" "$PWD/farm")
    is_idle() { [ -z "$(squeue -h -j "$job")" ]; }
    has_state() { grep -q NPGREC01state "farm/$1/job/store.npg" || is_idle; }
    controller=$(cat "$slurm/slurmctld.pid")
    await "$controller" has_state a >/dev/null
    await "$controller" has_state b >/dev/null
    scancel --batch --signal=TERM "${job}_2" # the one that has the job id of the array itself
    is_queued_again() { grep -q 'stopped, queued again' "task-$1.log" || is_idle; }
    await "$controller" is_queued_again 2
    sleep 0.2
    [ "$(grep -c 'stopping on request' task-1.log)" -eq 0 ] # the others go on
    scontrol requeue "${job}_1"
    await "$controller" is_idle
    cat task-*.log
    [ "$(cat task-*.log | grep -c 'stopped, queued again')" -eq 2 ]
    for capture in a b c; do
        [ -e farm/$capture/done.json ]
        grep -q '"exit_code": 0' farm/$capture/verdict.json
    done
    for capture in a b; do
        grep -q resumed_frames farm/$capture/report.json
        [ "$(grep -c '"event":"start"' farm/$capture/log.jsonl)" -eq 2 ]
        [ "$(grep -c '"event":"end".*"exit_code":75' farm/$capture/log.jsonl)" -eq 1 ]
    done
    [ "$(grep -c '"event":"start"' farm/c/log.jsonl)" -eq 1 ]
    [ "$(grep -c '"verdict": "done"' farm/batch.json)" -eq 3 ]
}

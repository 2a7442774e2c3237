# The command: verbs, help, options, exit codes.

setup() { cd "$BATS_TEST_TMPDIR" || return 1; }

@test "without a verb it lists the verbs and fails as wrong usage" {
    run "$NEUPIG"
    [ "$status" -eq 2 ]
    [[ "$output" == *"run "*"probe "*"eval "*"synth "*"render "*"doctor "* ]]
}

@test "an unknown verb is wrong usage" {
    run "$NEUPIG" rnu
    [ "$status" -eq 2 ]
    [[ "$output" == *'no verb "rnu"'* ]]
}

@test "every verb shows its own help in both ways" {
    for verb in run probe eval synth render view bench doctor help man version; do
        run "$NEUPIG" "$verb" --help
        [ "$status" -eq 0 ]
        [[ "${lines[0]}" == "Usage: neupig $verb"* ]]
        one="$output"
        run "$NEUPIG" help "$verb"
        [ "$status" -eq 0 ]
        [ "$output" = "$one" ]
    done
}

@test "help of an unknown verb is wrong usage" {
    run "$NEUPIG" help nothing
    [ "$status" -eq 2 ]
}

@test "an unknown option names the nearest one" {
    run "$NEUPIG" run in -o out --sed 3
    [ "$status" -eq 2 ]
    [[ "$output" == *"--sed"*"--seed"* ]]
    [ ! -e out ]
}

@test "an option without its value, or outside its range, is wrong usage" {
    run "$NEUPIG" synth -o out --frames
    [ "$status" -eq 2 ]
    [[ "$output" == *"--frames needs a value"* ]]
    run "$NEUPIG" synth -o out --frames 0
    [ "$status" -eq 2 ]
    [[ "$output" == *"frames"*"outside"* ]]
    run "$NEUPIG" synth -o out --frames 2x
    [ "$status" -eq 2 ]
    run "$NEUPIG" synth -o out --format horse
    [ "$status" -eq 2 ]
    [[ "$output" == *"ply|obj"* ]]
    [ ! -e out ]
}

@test "operands that are missing or too many are wrong usage" {
    run "$NEUPIG" eval one
    [ "$status" -eq 2 ]
    run "$NEUPIG" eval one two three
    [ "$status" -eq 2 ]
    [[ "$output" == *'"three"'* ]]
    run "$NEUPIG" run
    [ "$status" -eq 2 ]
    run "$NEUPIG" run in
    [ "$status" -eq 2 ]
    [[ "$output" == *"-o DIR"* ]]
}

@test "values stand after a space or an equals sign, flags with and without no-" {
    "$NEUPIG" synth --output=a --frames=1 --points=50 --no-normals
    "$NEUPIG" synth -o b --frames 1 --points 50 --normals=no
    cmp a/points/frame_0000.ply b/points/frame_0000.ply
    "$NEUPIG" synth -o c --frames 1 --points 50
    run cmp a/points/frame_0000.ply c/points/frame_0000.ply
    [ "$status" -eq 1 ]
}

@test "a method is a file or a text, its mistakes are named, and the command line wins" {
    echo '{"seed": 7, // a comment' >broken.json
    run "$NEUPIG" run in -o out --method broken.json
    [ "$status" -eq 2 ]
    [[ "$output" == *"broken.json:"* ]]
    echo '{"no-such-option": 7}' >unknown.json
    run "$NEUPIG" run in -o out --method unknown.json
    [ "$status" -eq 2 ]
    [[ "$output" == *"unknown.json"*"no-such-option"* ]]
    run "$NEUPIG" run in -o out --method missing.json
    [ "$status" -eq 2 ]
    run "$NEUPIG" run in -o out --method papr
    [ "$status" -eq 2 ]
    [[ "$output" == *'"papr"'* ]]
    echo '{"ring": 0}' >range.json
    run "$NEUPIG" run in -o out --method range.json
    [ "$status" -eq 2 ]
    run "$NEUPIG" run in -o out --method '{"epochs": -1}'
    [ "$status" -eq 2 ]
    [[ "$output" == *"epochs"*"outside"* ]]
    # The file alone would be refused for its input; with the command line's input another one is named.
    echo '{"input": "from-file", "output": "out"}' >good.json
    run "$NEUPIG" run --method good.json
    [ "$status" -eq 3 ]
    [[ "$output" == *"from-file"* ]]
    run "$NEUPIG" run from-line --method=good.json --method paper
    [ "$status" -eq 3 ]
    [[ "$output" == *"from-line"* ]]
}

@test "a mistyped verb, option or key is told what was meant" {
    run "$NEUPIG" rum in -o out
    [[ "$output" == *"did you mean run?"* ]]
    run "$NEUPIG" run in -o out --metod paper
    [[ "$output" == *"did you mean --method?"* ]]
    run "$NEUPIG" run in -o out --bar residual=1
    [[ "$output" == *"did you mean --bars?"* ]]
    run "$NEUPIG" run in -o out --method '{"epohs": 4}'
    [ "$status" -eq 2 ]
    [[ "$output" == *"did you mean epochs"* ]]
}

@test "the short help of run has 15 lines, and all options are at most 48" {
    "$NEUPIG" help run >short
    [ "$(wc -l <short)" -le 15 ]
    "$NEUPIG" help run --help-all >all
    [ "$(grep -cE '^ *--' all)" -le 48 ]
    [ "$("$NEUPIG" run --help)" = "$(cat short)" ]
    [ "$("$NEUPIG" run --help-all)" = "$(cat all)" ]
    grep -q "^    residual .*" all
    for verb in probe batch; do
        "$NEUPIG" help $verb >one
        run grep -E '^ *--(faces|frames|sensor) ' one
        [ "$status" -eq 1 ]
    done
}

@test "help as JSON, and the schema of a method" {
    command -v python3 >/dev/null || skip "python3 is not installed"
    for verb in run probe batch synth; do "$NEUPIG" help $verb --json >$verb.json; done
    "$NEUPIG" help method --json >schema.json
    python3 - <<'EOF'
import json
for verb in ("run", "probe", "batch", "synth"):
    options = json.load(open(verb + ".json"))["options"]
    assert options and all(o["name"] and o["option"].startswith("--") and len(o["description"]) > 5 for o in options)
schema = json.load(open("schema.json"))
assert schema["$schema"].endswith("2020-12/schema")
keys = schema["properties"]
assert keys["epochs"]["type"] == "integer" and keys["epochs"]["default"] == 60 and keys["epochs"]["minimum"] == 0
assert keys["align"]["type"] == "boolean" and "paper" in keys["preset"]["enum"] and "faces" in keys
run = json.load(open("run.json"))["options"]
assert {o["name"] for o in run} <= set(keys) | {"method", "progress", "log-file", "quiet", "verbose", "segments"}
EOF
}

@test "an option that went or moved says where to" {
    run "$NEUPIG" run in -o out --quality best
    [ "$status" -eq 2 ]
    [[ "$output" == *"went: --effort best"* ]]
    run "$NEUPIG" run in -o out --epochs 5
    [ "$status" -eq 2 ]
    [[ "$output" == *"option --epochs is a key of the method now: --method '{\"epochs\": 5}'"* ]]
    run "$NEUPIG" probe in --no-align
    [ "$status" -eq 2 ]
    [[ "$output" == *"--method '{\"align\": false}'"* ]]
    run "$NEUPIG" run in -o out --confidence=constant
    [ "$status" -eq 2 ]
    [[ "$output" == *"--method '{\"confidence\": \"constant\"}'"* ]]
    run "$NEUPIG" run in -o out --depth-near=1
    [ "$status" -eq 2 ]
    [[ "$output" == *"went: --depth-range A:"* ]]
    run "$NEUPIG" batch in -o out --dry-run
    [ "$status" -eq 2 ]
    [[ "$output" == *"option --dry-run went: neupig probe"* ]]
    run "$NEUPIG" view out --port=8000
    [ "$status" -eq 2 ]
    [[ "$output" == *"option --port went: --live"* ]]
    run "$NEUPIG" run in -o out --port=8000
    [[ "$output" == *"there is no option --port"* ]]
    run "$NEUPIG" run in -o out --pull
    [ "$status" -eq 2 ]
    [[ "$output" == *"for programs"* ]]
    [ ! -e out ]
}

@test "help method lists names and keys, which are no options of run" {
    "$NEUPIG" help method >method
    for name in default paper paper-1000 grids epochs align poisson-depth; do grep -q "^  $name " method; done
    "$NEUPIG" help run --help-all >run
    run grep -E '^  --(no-)?(epochs|align|ring|preset) ' run
    [ "$status" -eq 1 ]
}

@test "an input that does not exist is bad input and leaves nothing under a final name" {
    run "$NEUPIG" run nowhere -o out
    [ "$status" -eq 3 ]
    [[ "$output" == *"nowhere"* ]]
    [ ! -e out/done.json ]
}

@test "progress as JSON ends with a record of how it went" {
    "$NEUPIG" run nowhere -o out --progress json 2>/dev/null >lines || true
    tail -n 1 lines | grep -q '"event":"end".*"exit_code":3'
}

@test "the manual knows every verb" {
    "$NEUPIG" man >manual
    [[ "$(head -n 1 manual)" == ".TH NEUPIG 1"* ]]
    for verb in run probe eval synth render doctor; do
        grep -q "^.SS neupig $verb" manual
    done
    grep -q -- '--keep\\-going' manual || grep -q 'keep\\-going' manual
}

@test "output that can't be written is a disk failure" {
    [ -e /dev/full ] || skip "no /dev/full here"
    run bash -c '"$NEUPIG" man >/dev/full'
    [ "$status" -eq 5 ]
}

@test "version" {
    run "$NEUPIG" version
    [ "$status" -eq 0 ]
    [[ "$output" =~ ^neupig\ [0-9]+\.[0-9]+\.[0-9]+$ ]]
    run "$NEUPIG" --version
    [ "$status" -eq 0 ]
}

@test "doctor lists devices, and says so with exit code 4 where there is none" {
    run "$NEUPIG" doctor
    [ "$status" -eq 0 ]
    [[ "$output" == *"device 0:"*"self-test: ok"* ]]
    mkdir empty
    OCL_ICD_VENDORS="$PWD/empty" run "$NEUPIG" doctor
    [ "$status" -eq 4 ]
    [[ "$output" == *"no OpenCL driver is installed"* ]]
    OCL_ICD_VENDORS="$PWD/empty" run "$NEUPIG" doctor --json
    [ "$status" -eq 4 ]
}

# Selections, lists and standard input that neupig run refuses: the documented exit code, a message with file,
# place and cause, nothing under a final name.  (Folders and files that are bad: run.bats.)

setup() {
    cd "$BATS_TEST_TMPDIR"
    mkdir in
    for i in 1 2 3; do
        { printf 'ply\nformat ascii 1.0\nelement vertex 20\nproperty float x\nproperty float y\nproperty float z\nend_header\n'
          for k in $(seq 20); do echo "$k $((k * k % 7)) $((k * i % 5))"; done; } > "in/f$i.ply"
    done
}

# refused CODE WORDS INPUT OPTIONS...: the exit code, the words in the message, no result
refused() {
    local code=$1 words=$2
    shift 2
    run "$NEUPIG" run "$@" -o out --progress none
    echo "$output"
    [ "$status" -eq "$code" ]
    [[ "$output" == *"$words"* ]]
    [ ! -e out/done.json ] && [ ! -e out/report.json ] && [ ! -e out/reference.ply ]
}

@test "a selection that is malformed, or chooses nothing" {
    refused 2 "option frames: \"x\": not a frame number" in --frames x
    refused 2 "option frames: chooses none of the 3 frames of in" in --frames 7:
}

@test "standard input that is empty, ends inside a frame, or is something else" {
    refused 3 "standard input: no frame came" - < /dev/null
    head -c 200 in/f1.ply > cut
    refused 3 "frame 0: standard input: " - < cut
    cat in/f1.ply in/f2.ply cut > three
    refused 3 "frame 2: standard input: " - < three
    echo "not a cloud at all" > text
    refused 3 "begins neither as PLY nor as NPY" - < text
}

@test "a list with a path that is not there" {
    printf 'in/f1.ply\nin/f9.ply\n' > list.txt
    refused 3 "list.txt: line 2: there is no file in/f9.ply" list.txt
}

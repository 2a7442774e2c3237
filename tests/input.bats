# Bad input of neupig run: the documented exit code, a message with file, place and cause, nothing under a final
# name; and what goes on where going on is asked for.

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

@test "a missing folder, an empty one, one without clouds" {
    mkdir empty other
    echo hello > other/notes.md
    refused 3 "nowhere: there is no such file or folder" nowhere
    refused 3 "empty: no file here has a format that can be read" empty
    refused 3 "other: no file here has a format that can be read" other
}

@test "a file that can't be read" {
    ln -s /nowhere/at/all in/f4.ply
    refused 3 "in/f4.ply: can't be read: No such file" in
}

@test "a truncated file" {
    head -c 200 in/f2.ply > cut && mv cut in/f2.ply
    refused 3 "in/f2.ply: " in
}

@test "headers that lie" {
    for lie in 's/vertex 20/vertex -5/;line 3: negative count -5' \
               's/vertex 20/vertex 4000000000/;claims 4000000000 of element "vertex"' \
               's/vertex 20/vertex 19/;more data than the header declares' \
               's/float y/quaternion y/;line 5: unknown type "quaternion"' \
               's/float y/list uchar float y/;list property "y" in element vertex'; do
        cp in/f2.ply kept
        sed -i "${lie%%;*}" in/f2.ply
        refused 3 "in/f2.ply: " in
        [[ "$output" == *"${lie#*;}"* ]]
        mv kept in/f2.ply
    done
}

@test "a gap in the numbering" {
    rm in/f2.ply
    cp in/f3.ply in/f4.ply
    refused 3 "in: 1 of 4 frames are missing: 2" in
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

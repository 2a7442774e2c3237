# tools/release.sh, on a clone: what it changes, what it refuses.

setup() {
    cd "$BATS_TEST_TMPDIR"
    root=$(dirname "$(dirname "$BATS_TEST_DIRNAME")")
    export GIT_CONFIG_GLOBAL="$PWD/gitconfig"
    printf '[safe]\n\tdirectory = *\n[user]\n\tname = A\n\temail = a@localhost\n' >gitconfig
    git -C "$root" rev-parse --quiet --verify HEAD >/dev/null || skip "takes a checkout of git"
    git clone --quiet "$root" tree
    cp "$root/tools/release.sh" tree/tools/
    cp "$root/CHANGELOG.md" tree/
    cd tree
    git diff --quiet || git commit --quiet --all -m now
    version=$(sed -n 's/^project(neupig VERSION \([0-9.]*\).*/\1/p' CMakeLists.txt)
}

@test "it names the version everywhere, dates the changes, commits and tags" {
    tools/release.sh --no-packages 9.8.7
    [ "$(git describe)" = v9.8.7 ]
    [ -z "$(git status --porcelain)" ]
    grep -q '^project(neupig VERSION 9.8.7 ' CMakeLists.txt
    [ "$(grep -c '^#define NPG_VERSION_\(MAJOR 9\|MINOR 8\|PATCH 7\)$' pipeline/neupig.h)" -eq 3 ]
    grep -q '^version = "9.8.7"' tools/python/pyproject.toml
    grep -q '^VERSION = "9.8.7"' tools/python/neupig/_library.py
    grep -q '^version: 9.8.7$' tools/CITATION.cff
    ! grep -rnF "\"$version\"" pipeline tools tests/pipeline tests/delivery
    [ "$(grep -m 2 '^## ' CHANGELOG.md | xargs)" = "## Unreleased ## 9.8.7 ($(date +%F))" ]
}

@test "it refuses what is no release, and changes nothing" {
    refuses() { # WORDS ARGUMENTS...
        run tools/release.sh --no-packages "${@:2}"
        echo "$output"
        [ "$status" -eq 2 ]
        [[ "$output" == *"$1"* ]]
        [ "$(git log --oneline | wc -l)" -eq "$commits" ]
    }
    commits=$(git log --oneline | wc -l)
    refuses usage
    refuses usage 1.2
    refuses "comes before" 0.0.9
    git tag v9.8.7
    refuses "a tag v9.8.7 already" 9.8.7
    echo >>README.md
    refuses "not committed" 9.9.9
}

@test "security and citation are there, and the container installs the packages that cpack makes" {
    for file in SECURITY.md CITATION.cff Containerfile; do [ -s "$root/tools/$file" ]; done
    grep -q "^version: $version$" "$root/tools/CITATION.cff"
    grep -q 'tools/SECURITY.md' "$root/CONTRIBUTING.md"
    # all that it copies and runs is there
    for word in samples/packages.sh CMakePresets.json; do [ -e "$root/$word" ]; done
    (set -u; . "$root/samples/packages.sh" && [ -n "$packages_to_build" ])
    cmake --list-presets -S "$root" | grep -q '"release"'
}

# README, guide and the other pages: every command line in them is run, in a copy of the tree, with tiny captures in place of
# yours; every option, link and figure in them exists.

list_pages() {
    cd "$root" || return 1
    ls README.md ARCHITECTURE.md CONTRIBUTING.md */README.md tools/python/README.md samples/guide/*.md
}

setup_file() {
    root=$(dirname "$(dirname "$BATS_TEST_DIRNAME")")
    export root
    # pip must not need the network.
    export PIP_NO_INDEX=1 PIP_DISABLE_PIP_VERSION_CHECK=1 PYTHONDONTWRITEBYTECODE=1
}

setup() {
    commands="$BATS_TEST_DIRNAME/page_commands.sh"
    cd "$BATS_TEST_TMPDIR" || return 1
}

# A copy of the tree as a clone has it, with the build under test as its build folder.
copy_tree() { # FOLDER
    mkdir "$1"
    (cd "$root" && { git ls-files -coz --exclude-standard 2>/dev/null || find . -type f ! -path './build/*' ! -path './.git/*' -print0; }) |
        tar -C "$root" --null -T - --ignore-failed-read -c 2>/dev/null | tar -C "$1" -x
    ln -s "$(dirname "$NEUPIG")" "$1/build"
}

@test "every command line of every page runs, or says why it does not" {
    /usr/bin/python3 -c 'import numpy, venv, ensurepip' || skip "needs python3-numpy and python3-venv"
    PATH="/usr/bin:$PATH" # Debian's Python, which has NumPy
    ran=0 marked=0
    while read -r page; do
        copy_tree tree
        "$commands" "$root/$page" tree >page.log 2>&1 || { cat page.log; false; }
        cat page.log
        said=$(tail -n 1 page.log)
        [[ "$said" =~ ([0-9]+)\ commands\ run,\ ([0-9]+)\ marked ]]
        ran=$((ran + BASH_REMATCH[1])) marked=$((marked + BASH_REMATCH[2]))
        rm -rf tree
    done < <(list_pages)
    echo "$ran commands run, $marked marked"
    [ "$ran" -gt 40 ]
    [ "$marked" -lt 20 ]
    echo "# $ran commands of the pages run, $marked are marked" >&3
}

@test "what is said to be run by another test names one that reads the page" {
    while read -r page; do
        "$commands" --list "$root/$page" >list
        sed -n 's/^[0-9]*\trun by: \([^\t]*\)\t.*/\1/p' list | sort -u | while read -r test; do
            grep -q "$(basename "$page")" "$root/$test" || { echo "$page: $test does not run it"; false; }
        done
    done < <(list_pages)
}

@test "blocks that nobody would run are refused" {
    refused() { # TEXT MESSAGE
        printf '%b' "$1" >page.md
        run "$commands" --list page.md
        echo "$output"
        [ "$status" -ne 0 ]
        [[ "$output" == *"$2"* ]]
    }
    refused 'Text.\n\n    neupig run\n' "line 3: an indented block"
    refused '```\nneupig run\n```\n' "a block says what it is"
    refused '```json\n{}\n```\n' "says which file it is"
    refused '```sh\nneupig run\n' "a block without an end"
    refused 'Give `neupig run in -o out` first.\n' "a command line in a sentence"
    refused '<!-- not run: slow -->\nText.\n' "a mark stands right before its block"
    refused '<!-- not run -->\n' "a mark is one line"
}

@test "a command that fails is said with page and line, and nothing after it runs" {
    printf '```sh\ntrue\nls /nowhere \\\n    /either\ntouch after\n```\n' >page.md
    run "$commands" page.md
    echo "$output"
    [ "$status" -eq 1 ]
    [[ "$output" == *"page.md:3: exit code 2: ls /nowhere"* ]]
    [ ! -e after ]
}

@test "marked blocks are left out and listed; on a clean machine those of that test run" {
    printf '<!-- run by: tests/clean_machine.sh -->\n```sh\ntouch one\n```\n<!-- not run: slow -->\n```sh\ntouch two\n```\n' >page.md
    [ "$("$commands" --list page.md)" = $'3\trun by: tests/clean_machine.sh\ttouch one \n7\tnot run: slow\ttouch two ' ]
    run "$commands" page.md
    [ "${lines[-1]}" = "page.md: 0 commands run, 2 marked" ]
    run "$commands" --clean page.md
    [ "${lines[-1]}" = "page.md: 1 commands run, 1 marked" ]
    [ -e one ]
    [ ! -e two ]
}

@test "every option that a page names is one of the command or of a script" {
    for verb in run batch append export apply probe eval synth render view bench doctor man; do "$NEUPIG" help $verb --help-all; done >known
    "$NEUPIG-bodies" 2>>known || true
    for script in explore plot_explore figures options_page rig_json; do "$root/tools/$script.py" --help; done >>known
    # of CMake, CTest, pip, bats and others
    echo "--build --target --install --prefix --preset --config --test-dir --output-on-failure --system-site-packages --array" >>known
    echo "--cflags --libs --variable --list --clean --filter --tests --packages --fast --help-all" >>known
    # an option that is on by default is listed as --no-NAME, and may be set as --NAME=no
    grep -o -e '--[a-z][a-z0-9-]*' known | sed 'p; s/^--no-/--/' | sort -u >options
    while read -r page; do
        grep -o -e '\(^\|[ `]\)--[a-z][a-z0-9-]*' "$root/$page" | tr -d ' `' | sort -u | while read -r option; do
            grep -qxe "$option" options || { echo "$page: $option"; false; }
        done
    done < <(list_pages)
}

@test "every link of a page leads to a file" {
    while read -r page; do
        grep -o '](\([^)#]*\)' "$root/$page" | cut -c 3- | while read -r link; do
            case $link in
            '' | http*) ;;
            *) [ -e "$root/$(dirname "$page")/$link" ] || { echo "$page: $link"; false; } ;;
            esac
        done
    done < <(list_pages)
}

@test "every path in a page that begins with a folder of the tree exists" {
    while read -r page; do
        grep -o '`\(pipeline\|stages\|kernels\|tools\|tests\|samples\)/[A-Za-z0-9_./-]*`' "$root/$page" | tr -d '`' | while read -r path; do
            [[ "$path" == *NAME* || -e "$root/$path" ]] || { echo "$page: $path"; false; }
        done
    done < <(list_pages)
}

@test "the README has at most 900 words" {
    [ "$(wc -w <"$root/README.md")" -le 900 ]
}

@test "tables and picture are what the figures' file says; another figure is noticed" {
    command -v python3 >/dev/null || skip "python3 is not installed"
    "$root/tools/figures.py" --check
    copy_tree tree
    sed -i '/"capture": "dancer17", "options": ""/s/"CD": [0-9.]*/"CD": 9.87/' tree/samples/guide/figures.json
    run tree/tools/figures.py --check
    echo "$output"
    [ "$status" -eq 1 ]
    [[ "$output" == *"README.md is not what"* ]]
    tree/tools/figures.py --write-pages
    tree/tools/figures.py --check
    grep -q '9\.87' tree/README.md
}

@test "figures are measured once, on captures that are at hand, and measuring resumes" {
    command -v python3 >/dev/null || skip "python3 is not installed"
    "$NEUPIG-bodies" --body bar --frames 3 --points 800 -o small >/dev/null
    measure() { "$root/tools/figures.py" --file mine.json --work work --only dancer17 --table quality --at-most 1 "$@"; }
    run measure --capture dancer17=small/points,small/truth
    echo "$output"
    [ "$status" -eq 3 ] # more to do
    [ "$(grep -c '"exit_code"' mine.json)" -eq 1 ]
    grep -q '"command": "neupig run dancer17 -o OUT", "version": ' mine.json
    grep -q '"CD": [0-9]' mine.json
    run measure
    echo "$output"
    [[ "$output" == *"dancer17 is not at hand"* ]]
    [ "$status" -eq 0 ]
    [ "$(grep -c '"exit_code"' mine.json)" -eq 1 ]
}

@test "the page of all options is that of the program" {
    "$root/tools/options_page.py" "$NEUPIG" --check
    [ "$(grep -c '^| `--' "$root/samples/guide/options.md")" -gt 100 ]
}

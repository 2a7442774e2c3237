#!/bin/bash
# The command lines of a page (README.md, samples/guide/*.md ...), listed or run one after the other.
#
#   tests/delivery/page_commands.sh PAGE [FOLDER]     run them in FOLDER (.), a copy of the tree that may be written to
#   tests/delivery/page_commands.sh --list PAGE       LINE, how (run, or why not), and command, parted by tabs
#   tests/delivery/page_commands.sh --clean PAGE      as the first, on a machine where nothing is built yet: with the
#                                                     commands that are marked "run by: tests/clean_machine.sh"
#
# How a page says what is to be done with its blocks:
#
#   ```sh                    command lines; each is run, all of a page in one shell, in order
#   ```text                  anything else that nobody runs: a layout, what a command prints
#   <!-- file: NAME -->      before any other block: it becomes the file NAME, for the commands that follow
#   <!-- not run: WHY -->    before a block of commands that no test can run
#   <!-- run by: PATH -->    before a block of commands that another test runs
#   <!-- test: COMMAND -->   a command that only the test needs, run at this place
#
# A command is right when it ends with 0, or with 7 (done, with frames below the bar: the captures here are tiny).  The
# captures and meshes that pages speak of (my-capture/, captures/, scan.obj, my-model.obj) are made when a command names them,
# and what a page makes with thousands of points a frame has some hundred here.
# Blocks that are indented, or of no kind, are refused, so that no command line slips through.  Needs bash and awk alone.
set -euo pipefail

usage() {
    sed -n '2,9s/^# \{0,1\}//p' "$0" >&2
    exit 2
}

# Read PAGE and print a line for every thing to do: LINE <tab> KIND <tab> TEXT, with line breaks in TEXT as \x01.
# KIND is run, test, skip (TEXT begins with the reason and \x02), other (the same with a path) or file (name, \x02, text).
parse_page() { # PAGE
    awk -v page="$1" '
        function wrong(text) { printf "%s, line %d: %s\n", page, NR, text > "/dev/stderr"; failed = 1; exit 1 }
        function mark_of(name) { return $0 ~ "^<!-- " name ": .* -->$" }
        function mark_text(name) { return substr($0, length(name) + 8, length($0) - length(name) - 11) }
        function give_command() {
            if (command == "") return
            if (why != "") print first "\tskip\t" why "\002" command
            else if (by != "") print first "\tother\t" by "\002" command
            else print first "\trun\t" command
            command = ""
        }
        # A command ends with its line, unless that ends with a backslash or the next one is indented.
        function add_command() {
            if ($0 ~ /^[ \t]*(#.*)?$/) { give_command(); return }
            if (command != "" && !open_line && $0 !~ /^[ \t]/) give_command()
            if (command == "") first = NR
            command = command == "" ? $0 : command "\001" $0
            open_line = $0 ~ /\\$/
        }
        in_block && /^```$/ {
            if (kind == "sh") give_command()
            else if (name != "") print first "\tfile\t" name "\002" body
            in_block = 0; why = by = name = ""
            next
        }
        in_block {
            if (kind == "sh") add_command()
            else body = body == "" ? $0 : body "\001" $0
            next
        }
        /^```/ {
            kind = substr($0, 4)
            if (kind !~ /^[a-z]+$/) wrong("a block says what it is: ```sh, ```text ...")
            if (kind == "sh" && name != "") wrong("commands are no file")
            if (kind != "sh" && kind != "text" && name == "") wrong("a block of " kind " says which file it is: <!-- file: NAME -->")
            in_block = 1; command = body = ""; first = NR + 1; open_line = 0
            next
        }
        /^    / { wrong("an indented block: write ```sh or ```text") }
        mark_of("not run") { why = mark_text("not run"); next }
        mark_of("run by") { by = mark_text("run by"); next }
        mark_of("file") { name = mark_text("file"); next }
        mark_of("test") { print NR "\ttest\t" mark_text("test"); next }
        /^<!-- (not run|run by|file|test)/ { wrong("a mark is one line: <!-- NAME: TEXT -->") }
        !/^$/ && (why != "" || by != "" || name != "") { wrong("a mark stands right before its block") }
        # Commands in sentences would be run by nobody: there only verbs are named, as in `neupig run`.
        {
            line = $0
            while (match(line, /`[^`]+`/)) {
                span = substr(line, RSTART + 1, RLENGTH - 2)
                line = substr(line, RSTART + RLENGTH)
                if (span ~ /^(build\/)?neupig [a-z]+ / && span !~ /^(build\/)?neupig help [a-zA-Z]+$/)
                    wrong("a command line in a sentence: `" span "`")
            }
        }
        END { if (!failed && in_block) wrong("a block without an end") }' "$1"
}

list_page() { # PAGE
    parse_page "$1" | while IFS=$'\t' read -r line kind text; do
        case $kind in
        run) how=run ;;
        skip | other) how="${kind/skip/not run}: ${text%%$'\x02'*}" how=${how/other/run by} ;;
        *) continue ;;
        esac
        printf '%s\t%s\t%s\n' "$line" "$how" "$(tr '\001' '\n' <<<"${text#*$'\x02'}" | sed 's/\\$//' | tr '\n' ' ')"
    done
}

# ---- what pages take for granted ----

synth() { # FOLDER OPTIONS...: points alone, as a capture from anywhere
    local folder=$1
    shift
    neupig synth -o "$folder.synth" --cell 0.06 --points 600 "$@" >/dev/null
    mkdir -p "$(dirname "$folder")"
    mv "$folder.synth/points" "$folder"
    [ ! -e "$folder.truth" ] && mv "$folder.synth/truth" "$folder.truth"
    rm -r "$folder.synth"
}

# A mesh of somebody's own that lies on the reference of out/: that of the keyframe, as OBJ.
provide_mesh() {
    local key
    [ ! -e scan.obj ] || return 0
    key=$(sed -n 's/^{"index":[0-9]*,"number":\([0-9]*\),.*"key":true,.*/\1/p' out/frames.jsonl)
    neupig apply out --mesh out/reference.ply --export obj -o carried.obj >/dev/null
    cp "carried.obj/frame_$(printf %04d "$key").obj" scan.obj
    cp scan.obj my-model.obj
    rm -r carried.obj
}

# Make what the command names and what is not there yet.
provide() { # COMMAND
    case $1 in *my-capture*) [ -e my-capture ] || synth my-capture --frames 5 --cycles 0.3 --noise 0.1 ;; esac
    case $1 in *entering/*) [ -e entering ] || neupig-bodies --body two --frames 18 --cell 0.06 --points 400 --seed 2 -o entering >/dev/null ;; esac
    case $1 in *scan.obj* | *my-model.obj*) provide_mesh ;; esac
    case $1 in
    *captures/* | *night.json* | *dancer* | *horse*)
        [ -e captures ] || {
            synth captures/dancer --frames 3 --cycles 0.2
            synth captures/horse --frames 3 --cycles 0.3 --seed 1
            rm -r captures/*.truth
        }
        ;;
    esac
}

run_file() { # LINE NAME TEXT
    mkdir -p "$(dirname "$2")"
    tr '\001' '\n' <<<"$3" >"$2"
    echo "$page:$1: writes $2"
}

run_command() { # LINE COMMAND
    local page_start=$SECONDS page_code=0
    provide "$2"
    eval "$(sed -E '/^neupig synth/s/(--points [0-9])000( |$)/\100\2/' <<<"$2")" </dev/null >"$page_log" 2>&1 || page_code=$?
    if [ $page_code -ne 0 ] && [ $page_code -ne 7 ]; then
        cat "$page_log"
        echo "$page:$1: exit code $page_code: $2"
        exit 1
    fi
    echo "$page:$1: $page_code in $((SECONDS - page_start)) s: ${2%%$'\n'*}"
}

run_page() {
    local page_line page_kind page_text page_ran=0 page_left=0
    # The commands keep this shell: what one exports, and where one goes to, holds for the next.
    while IFS=$'\t' read -r page_line page_kind page_text <&3; do
        [ "$page_kind" != other ] || [ -z "$clean" ] || page_kind=run page_text=${page_text#*$'\x02'}
        case $page_kind in
        run | test)
            run_command "$page_line" "${page_text//$'\x01'/$'\n'}"
            [ "$page_kind" = test ] || page_ran=$((page_ran + 1))
            ;;
        skip | other) page_left=$((page_left + 1)) ;;
        file) run_file "$page_line" "${page_text%%$'\x02'*}" "${page_text#*$'\x02'}" ;;
        esac
    done 3< <(printf '%s' "$page_lines")
    echo "$page: $page_ran commands run, $page_left marked"
}

clean="" list=""
case ${1:-} in
--clean) clean=yes ;;
--list) list=yes ;;
esac
[ -z "$clean$list" ] || shift
[ $# -ge 1 ] && [ $# -le 2 ] && [ -f "$1" ] || usage
page=$1
if [ -n "$list" ]; then
    list_page "$page"
    exit
fi
page_lines=$(parse_page "$page")$'\n'
cd "${2:-.}"
page_log=$(mktemp)
trap 'rm -f "$page_log"' EXIT
PATH="$PWD/build:$PATH"
run_page

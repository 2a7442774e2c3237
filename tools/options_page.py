#!/usr/bin/env python3
"""The guide's page of all options, from the tables of the program itself: without an option it is printed."""

import argparse
import pathlib
import re
import subprocess
import sys

PAGE = pathlib.Path(__file__).resolve().parents[1] / "samples" / "guide" / "options.md"
HEAD = """# All options

Made by `tools/options_page.py` from the program's own tables; `neupig help VERB` says the same.

"""
OPTION = re.compile(r"^  (-{0,2}[a-z][a-z0-9-]*(?: [A-Z][^ ]*)?)(?: +(.*))?$")  # two spaces, a name and its value
PART = re.compile(r"^    ([a-z][a-z0-9-]*) +(.*)$")  # four: a part of the value above


def help_of(program: str, *words: str) -> list[str]:
    return subprocess.run([program, "help", *words], check=True, capture_output=True, text=True).stdout.splitlines()


def cell(text: str) -> str:
    return re.sub(r"([|<>*])", r"\\\1", text)


def table_of(rows: list[list[str]], head: str) -> str:
    return f"| {head} | |\n|---|---|\n" + "".join(f"| `{cell(name)}` | {cell(text)} |\n" for name, text in rows) + "\n"


def groups_of(lines: list[str]) -> list[tuple[str, list[list[str]]]]:
    """Titles (lines at the margin that end with a colon) with the options below them."""
    groups: list[tuple[str, list[list[str]]]] = [("", [])]
    for line in lines:
        option, part = OPTION.match(line), PART.match(line)
        rows = groups[-1][1]
        if option or part:
            found = option or part
            rows.append([found[1] if option else f"... {found[1]}", found[2] or ""])
        elif line.startswith(" " * 20) and rows:
            rows[-1][1] = f"{rows[-1][1]} {line.strip()}".strip()
        elif line.endswith(":") and not line.startswith(" "):
            groups.append((line[:-1], []))
    return [(title, rows) for title, rows in groups if rows]


def page_of(program: str) -> str:
    text = HEAD
    for verb, what in groups_of(help_of(program))[0][1]:
        if verb in ("help", "man", "version"):
            continue
        groups = groups_of(help_of(program, verb, "--help-all"))
        options = [(title, [row for row in rows if row[0].startswith(("--", "..."))]) for title, rows in groups]
        text += f"## neupig {verb}\n\n{what}.\n\n"
        for title, rows in options:
            text += table_of(rows, title or "option") if rows else ""
    text += "## Keys of --method\n\n"
    for title, rows in groups_of(help_of(program, "method")):
        text += table_of(rows, title)
    return text.rstrip("\n") + "\n"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("program", help="build/neupig")
    parser.add_argument("--check", action="store_true", help=f"exit code 1 where {PAGE.name} is another")
    parser.add_argument("--write", action="store_true", help="write it")
    asked = parser.parse_args()
    text = page_of(asked.program)
    if asked.write:
        PAGE.write_text(text, encoding="utf-8")
    elif not asked.check:
        print(text, end="")
    elif not PAGE.exists() or PAGE.read_text(encoding="utf-8") != text:
        sys.exit(f"{PAGE} is not what {asked.program} has: tools/options_page.py {asked.program} --write")


if __name__ == "__main__":
    main()

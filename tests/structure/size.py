#!/usr/bin/env python3
"""How large the program is: lines of C, options of `run`, libraries that the command loads, tuned constants.

    size.py ROOT [NEUPIG]            a line for each figure
    size.py ROOT [NEUPIG] --check    exit code 1 names each that is above its bound in budget.json, beside this script
    size.py ROOT NEUPIG --row        lines, options and constants, parted by commas (tests/accuracy.py)

Without NEUPIG, the built command, options and libraries are left out.  The bounds are lowered whenever something lands that
made a figure smaller; whoever must raise one says why in the commit.
"""

import json
import pathlib
import re
import subprocess
import sys

sys.path.insert(0, str(pathlib.Path(__file__).parent))
import constants  # noqa: E402

FOLDERS = ("pipeline", "stages", "kernels", "tools")
SOURCES = (".c", ".h", ".cl", ".clh", ".cpp", ".hpp")


def count_lines(root, folder):
    return sum(path.read_bytes().count(b"\n") for path in (root / folder).rglob("*") if path.suffix in SOURCES)


def output_of(*command):
    return subprocess.run(command, capture_output=True, text=True, check=False).stdout


def count_options(neupig):
    shown = output_of(neupig, "help", "run", "--help-all") or output_of(neupig, "help", "run")
    return len(re.findall(r"^ +--", shown, re.MULTILINE))


def measure(root, neupig):
    lines = {folder: count_lines(root, folder) for folder in FOLDERS}
    figures = {"lines": sum(lines.values()), **{f"lines of {folder}": count for folder, count in lines.items()},
               "constants": len(list(constants.read_constants(root)))}
    if neupig:
        figures["options of run"] = count_options(neupig)
        figures["libraries"] = len(output_of("ldd", neupig).splitlines())
    return figures


def main():
    words = [word for word in sys.argv[1:] if not word.startswith("--")]
    figures = measure(pathlib.Path(words[0]), words[1] if len(words) > 1 else None)
    if "--row" in sys.argv:
        print(figures["lines"], figures["options of run"], figures["constants"], sep=",")
        return 0
    for name, figure in figures.items():
        print(f"{name:18} {figure:6}")
    if "--check" not in sys.argv:
        return 0
    bounds = json.loads((pathlib.Path(__file__).parent / "budget.json").read_text())
    above = [name for name, figure in figures.items() if figure > bounds.get(name, figure)]
    for name in above:
        print(f"{name}: {figures[name]} is above the bound of {bounds[name]} in tests/structure/budget.json")
    return 1 if above else 0


if __name__ == "__main__":
    sys.exit(main())

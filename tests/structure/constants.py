#!/usr/bin/env python3
"""The tuned constants of the method: numbers that a trial has set, and that another capture may want otherwise.

    constants.py ROOT [--list]    how many there are in each room, and all together; --list names each

What counts: a #define of one number, an enumeration of one name or a static const of one number, in a .c, .h, .cpp or
.hpp file of a room of the method (ROOMS), or of a header that several rooms share (stages/*.h, limits.h).

What does not, because nobody sets it by looking at a figure:
  - sizes of buffers and tables, numbers of threads, of warnings and of what is said: one of the words SIZES in the
    name of a whole number, one of the words SAID in any
  - whole numbers from AMOUNT on: how many points, cells or steps are afforded, which costs time and does not decide
  - numbers below FLOOR or from CEILING on: guards against a division by nothing, and against what is no coordinate
  - negative whole numbers: marks for "none"
  - constants of mathematics (MATHEMATICS)
Units, facts of formats and the rooms that hold them (ingest, export, job, geometry, kernels) are outside, too.  By this rule
commit e48a615 has 226.
"""

import pathlib
import re
import sys

ROOMS = {"outlier", "keyframe", "mesh", "align", "track", "reference", "fuse", "optimize", "evaluate"}
SIZES = {"BYTES", "SIZE", "BITS", "BLOCK", "BLOCKS", "BATCH", "LANES", "UNITS", "THREADS", "ROW", "ROWS", "CELL", "PARTS",
         "MATCHERS", "BUFFER", "MAX", "MOST", "TERMS", "BIND", "FIXED", "OPEN", "LAYERS"}
SAID = {"SHOWN", "TOLD", "WARNINGS", "JACOBI", "FULL"}
AMOUNT, FLOOR, CEILING = 24, 1.0001e-4, 1e4
MATHEMATICS = {"1.4826", "12.5663706", "3.545", "2.399963229728653"}  # deviations of a median, 4 pi, its root, golden angle

NUMBER = r"\(?(-?\d[\d.]*(?:[eE][+-]?\d+)?)[fF]?\)?"
FORMS = [re.compile(form) for form in (
    rf"^\s*#\s*define\s+(\w+)\s+{NUMBER}\s*(?:/[*/].*)?$",
    rf"^\s*(?:typedef )?enum\s*\{{\s*(\w+)\s*=\s*{NUMBER}\s*\}}",
    rf"^\s*(?:static\s+)?const\s+(?:double|float|u?int\d*(?:_t)?|size_t)\s+(\w+)\s*=\s*{NUMBER}\s*;",
)]


def is_tuned(name, text):
    """Whether a constant of that name and number is one that trials set."""
    words, value = set(name.upper().split("_")), float(text)
    if text in MATHEMATICS or words & SAID or abs(value) >= CEILING or 0 < abs(value) < FLOOR:
        return False
    is_whole = "." not in text and "e" not in text.lower()
    return not (is_whole and (words & SIZES or value >= AMOUNT or value < 0))


def read_constants(root):
    """(room, place, name, number) of each tuned constant below stages/."""
    for path in sorted((root / "stages").rglob("*")):
        if path.suffix not in (".c", ".h", ".cpp", ".hpp"):
            continue
        parts = path.relative_to(root / "stages").parts
        room = parts[0] if len(parts) > 1 else "shared"
        if room != "shared" and room not in ROOMS and path.name != "limits.h":
            continue
        lines = path.read_text(errors="replace").splitlines()
        for number, line in enumerate(lines, 1):
            if line.endswith("\\") and number < len(lines):
                line = line[:-1] + lines[number]
            match = next(filter(None, (form.match(line) for form in FORMS)), None)
            if match and is_tuned(match[1], match[2]):
                yield room, f"{path.relative_to(root)}:{number}", match[1], match[2]


def main():
    constants = list(read_constants(pathlib.Path(sys.argv[1])))
    if "--list" in sys.argv:
        for _, place, name, number in constants:
            print(f"{place}: {name} {number}")
    for room in sorted({constant[0] for constant in constants}):
        print(f"{room:10} {sum(constant[0] == room for constant in constants):4}")
    print(f"{'all':10} {len(constants):4}")


if __name__ == "__main__":
    main()

#!/usr/bin/env python3
"""Every figure of the pages from one source: measures it, keeps it in samples/guide/figures.json, writes the tables.

    tools/figures.py --work DIR --capture dancer17=POINTS,TRUTH --capture horse17=POINTS,TRUTH ...
    tools/figures.py --write-pages
    tools/figures.py --check

The first measures the runs that the tables below need and the file does not have yet, on the captures that are named and on
made ones (walker...), and writes each into the file as it ends: stopped, it resumes.  --again measures those of --table or
--only anew.  The second puts the tables into the pages, between <!-- figures: NAME --> and <!-- end of figures -->, and the
picture beside them; the third fails where a page and the file differ (exit code 1).  Needs Python 3 alone.
"""
import argparse
import json
import os
import shlex
import shutil
import subprocess
import sys

import measure
import plot_explore

TREE = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
FILE = "samples/guide/figures.json"
PICTURE = "samples/guide/accuracy.svg"
PAGES = ("README.md", "samples/guide/figures.md", "samples/guide/defaults.md")

# Captures by the names that the pages give them.  Those with options are made by neupig synth; the others are handed in.
CAPTURES = {
    "dancer17": ("dancer, 17 frames", None),
    "dancer40": ("dancer, 40 frames", None),
    "dancer96": ("dancer, 96 frames", None),
    "dancer175": ("dancer, 175 frames", None),
    "horse17": ("galloping horse, 17 frames", None),
    "noisy40": ("dancer, 40 frames, with noise, outliers and holes, without normals", None),
    "sparse40": ("dancer, 40 frames of 800 points", None),
    "fast24": ("galloping horse, every second frame (24)", None),
    "cameras48": ("dancer as three sensors see it, 48 frames, without normals", None),
    "person17": ("a person's upper body before one depth camera, 17 frames, no truth", None),
    "walker24": ("walking figure, 24 noisy frames",
                 "--frames 24 --points 5000 --noise 0.1 --outliers 0.5 --no-normals"),
    "walker96": ("walking figure, 96 frames", "--frames 96 --points 5000 --cycles 4"),
    "walker960": ("walking figure, 960 frames", "--frames 960 --points 5000 --cycles 40"),
    "walker17": ("walking figure on its place, 17 frames", "--frames 17 --points 3000 --cycles 0.3"),
    "walker17far": ("walking figure that goes 3.6 m, 17 frames", "--frames 17 --points 3000 --cycles 0.3 --travel 12"),
}

# The published code of the paper's authors, unchanged, 250 epochs, with PyTorch 1.13 on the same kind of machine (two cores,
# AVX-512): measured once, with the same metrics.
PUBLISHED = {
    "dancer17": {"CD": 0.270, "NC": 0.9636, "F": 0.9956, "Corr": 0.0097, "wall_s": 343, "memory_mib": 3584},
    "dancer40": {"CD": 0.281, "NC": 0.9711, "F": 0.9964, "Corr": 0.0056, "wall_s": 700, "memory_mib": 7782},
    "horse17": {"CD": 1.04, "NC": 0.933, "F": 0.952, "Corr": 0.0315},
}

FORMATS = {"CD": "{:.3f}", "worst_CD": "{:.2f}", "NC": "{:.3f}", "F": "{:.3f}", "Corr": "{:.4f}", "worst_Corr": "{:.4f}",
           "jitter": "{:.4f}", "cpu_s": "{:.0f}", "wall_s": "{:.0f}", "memory_mib": "{:.0f}", "point_dist_median": "{:.5f}",
           "coverage": "{:.3f}"}
HEADS = {"CD": "CD", "worst_CD": "worst CD", "NC": "NC", "F": "F-0.5 %", "Corr": "Corr", "worst_Corr": "worst Corr",
         "jitter": "jitter", "cpu_s": "processor s", "wall_s": "s", "memory_mib": "MiB", "point_dist_median": "points to surface",
         "coverage": "coverage"}


def fail(text):
    sys.exit(f"figures: {text}")


def shown(key, value):
    return "-" if value is None else FORMATS[key].format(value)


# ---- the tables: what is in them decides what is measured ----

PAPER = "--method paper"


def keys_of_method(**keys):
    """The option that sets some keys of the method."""
    return f"--method '{json.dumps({key.replace('_', '-'): value for key, value in keys.items()})}'"


ALIGNED = keys_of_method(epochs=0)
FEW_NODES = keys_of_method(align_nodes=400)


class Cell:
    """One figure of one run."""

    def __init__(self, capture, options, key):
        self.capture, self.options, self.key = capture, options, key


def row(label, capture, options, keys):
    """A capture and its options in words, and the figures of that run."""
    return [label, f"`{options}`" if options else ""] + [Cell(capture, options, key) for key in keys]


def published_row(capture, keys):
    figures = PUBLISHED[capture]
    return ["", "published code"] + [shown(key, figures.get(key)) for key in keys]


def table_of_runs(keys, *rows):
    return [["capture", "options"] + [HEADS[key] for key in keys]] + list(rows)


def table_of_captures(first_heads, captures, keys, rows):
    """A row for every setting (its words and its options), columns for every capture and figure."""
    heads = list(first_heads)
    for capture in captures:
        heads += [f"{CAPTURES[capture][0]}: {HEADS[keys[0]]}"] + [HEADS[key] for key in keys[1:]]
    body = [list(words) + [Cell(capture, options, key) for capture in captures for key in keys]
            for words, options in rows]
    return [heads] + body


def coded(*settings):
    """Rows of one option each: (`--option`), option."""
    return [((f"`{s}`" if s else "default",), s) for s in settings]


def main_table(keys, compared, alone_standing):
    """Captures with default, paper's method and published code; then some with the default alone."""
    rows = []
    for capture in compared:
        rows.append(row(CAPTURES[capture][0], capture, "", keys))
        rows.append(row("", capture, PAPER, keys))
        rows.append(published_row(capture, keys))
    rows += [row(CAPTURES[capture][0], capture, "", keys) for capture in alone_standing]
    return table_of_runs(keys, *rows)


TABLES = {
    "main": main_table(("CD", "NC", "F", "Corr", "cpu_s", "memory_mib"), ("dancer17", "horse17"), ("dancer175", "walker24")),
    "all": main_table(("CD", "NC", "F", "Corr", "jitter", "wall_s", "cpu_s", "memory_mib"), ("dancer17", "dancer40", "horse17"),
                      ("dancer175", "noisy40", "walker24", "walker960")),
    "no truth": table_of_runs(("point_dist_median", "coverage", "cpu_s", "memory_mib"),
                              row(CAPTURES["person17"][0], "person17", "",
                                  ("point_dist_median", "coverage", "cpu_s", "memory_mib"))),
    "memory": table_of_runs(("Corr", "worst_Corr", "memory_mib", "cpu_s"),
                            row(CAPTURES["walker96"][0], "walker96", "", ("Corr", "worst_Corr", "memory_mib", "cpu_s")),
                            row(CAPTURES["walker960"][0], "walker960", "", ("Corr", "worst_Corr", "memory_mib", "cpu_s"))),
    "identity": table_of_captures(
        ("way", "options"), ("dancer17", "horse17"), ("CD", "Corr"),
        [((words, f"`{options}`" if options else ""), options) for words, options in (
            ("one joint window, every vertex, from the reference (the paper)", PAPER),
            ("alignment from frame to frame alone", ALIGNED),
            ("alignment, then the joint fit of windows (default)", ""))]),
    "joint": table_of_runs(("CD", "NC", "Corr", "jitter", "cpu_s"), *[
        row(CAPTURES[capture][0] if not options else "", capture, options, ("CD", "NC", "Corr", "jitter", "cpu_s"))
        for capture in ("dancer17", "dancer175", "horse17", "noisy40", "sparse40", "fast24", "cameras48")
        for options in ("", ALIGNED)]),
    "hundreds": table_of_captures(
        ("way", "options"), ("dancer96", "walker96"), ("CD", "Corr", "worst_Corr"),
        [((words, f"`{options}`" if options else ""), options) for words, options in (
            ("alignment, then windows of 24, overlap 4 (default)", ""),
            ("alignment alone", ALIGNED),
            ("one joint window after the alignment", keys_of_method(window=0)),
            ("more weight along the surface", keys_of_method(align_along=0.05)),
            ("stiffer", keys_of_method(align_stiffness=0.02)))]),
    "along": table_of_captures(
        ("options",), ("dancer17", "horse17", "noisy40"), ("CD", "Corr"),
        coded(keys_of_method(align_along=0.01), "", keys_of_method(align_along=0.0001))),
    "whole": table_of_captures(
        ("options",), ("walker17", "walker17far"), ("CD", "Corr"),
        coded(ALIGNED + " --keyframe 8", "--keyframe 8")),
    "fit": table_of_captures(
        ("options",), ("dancer17", "horse17"), ("CD", "Corr"),
        coded(keys_of_method(preset="paper", smoothing="screened"), keys_of_method(preset="paper", hold_apart="loose"), PAPER)),
    "apart": table_of_captures(
        ("options",), ("dancer40", "horse17"), ("CD", "Corr"),
        coded(keys_of_method(hold_apart="no"), "")),
    "quality": table_of_captures(
        ("options",), ("dancer17", "horse17"), ("CD", "Corr", "cpu_s"),
        coded("", FEW_NODES, keys_of_method(align_nodes=400, epochs=0), ALIGNED)),
}

# The picture: these settings on these captures.
PICTURED = [(capture, options) for capture in ("dancer17", "horse17") for options in (
    "", ALIGNED, FEW_NODES, keys_of_method(align_nodes=400, epochs=0), PAPER)] + [
        ("dancer17", keys_of_method(preset="paper", epochs=epochs)) for epochs in (60, 125)]


def wanted(table):
    """[(capture, options)] of one table, or of all and the picture; each once."""
    cells = [cell for name, rows in TABLES.items() if table in ("", name) for line in rows for cell in line]
    runs = [(cell.capture, cell.options) for cell in cells if isinstance(cell, Cell)]
    return list(dict.fromkeys(runs + (PICTURED if not table else [])))


# ---- the file ----

def read_file(path):
    if not os.path.exists(path):
        return {"runs": []}
    with open(path, encoding="utf-8") as file:
        return json.load(file)


def write_file(path, figures):
    """A line for every run, so that changes can be read."""
    order = {run: i for i, run in enumerate(wanted(""))}
    runs = sorted(figures["runs"], key=lambda r: (order.get(key_of(r), len(order)), key_of(r)))
    lines = ["{", ' "about": "Measured by tools/figures.py; units as in neupig eval, lengths in diagonals of the box",']
    lines.append(f' "captures": {json.dumps({name: what[0] for name, what in CAPTURES.items()}, indent=1)},')
    lines.append(f' "published": {json.dumps(PUBLISHED)},')
    lines.append(' "runs": [\n  ' + ",\n  ".join(json.dumps(run) for run in runs) + "\n ]\n}\n")
    with open(path + ".part", "w", encoding="utf-8") as out:
        out.write("\n".join(lines))
    os.replace(path + ".part", path)


def key_of(run):
    return run["capture"], run["options"]


# ---- measuring ----

def points_of(arguments, name):
    """(points, truth, frames) of a capture; None where it is not at hand."""
    for text in arguments.capture:
        given = measure.parse_capture(text, fail)
        if given[0] not in CAPTURES:
            fail(f"--capture {given[0]}: there are {', '.join(CAPTURES)}")
        if given[0] == name:
            return given[1:]
    options = CAPTURES[name][1]
    if options is None:
        return None
    made = measure.synth(arguments.neupig, os.path.join(arguments.work, name), shlex.split(options))
    return *made, ""


def measure_run(arguments, name, options):
    capture = points_of(arguments, name)
    if not capture:
        return None
    measure.note(f"figures: {name} {options}")
    folder = os.path.join(arguments.work, "run")
    run = {"capture": name, "options": options, "command": f"neupig run {name} -o OUT {options}".strip()}
    run.update(measure.source(arguments.neupig))
    run["machine"] = measure.machine()
    run.update(measure.measure(arguments.neupig, *capture, shlex.split(options), folder))
    if run["exit_code"] not in (0, 7):
        fail(f"{run['command']}: exit code {run['exit_code']}, see {folder}.log")
    shutil.rmtree(folder, ignore_errors=True)
    return run


def cost(run):
    """What is cheap comes first: the paper's fit takes many times longer, frames as they are."""
    return "paper" in run[1], int("".join(letter for letter in run[0] if letter.isdigit()))


def measure_all(arguments):
    os.makedirs(arguments.work, exist_ok=True)
    only = [text.strip() for text in arguments.only]
    left, missing, again = arguments.at_most, [], set()
    while left:
        figures = read_file(arguments.file)  # anew: others may measure beside
        have = {key_of(run) for run in figures["runs"]}
        for key in sorted(wanted(arguments.table), key=cost):
            if (only and key[0] not in only) or key in missing or (key in have and (not arguments.again or key in again)):
                continue
            run = measure_run(arguments, *key)
            break
        else:
            break
        if not run:
            missing.append(key)
            continue
        figures = read_file(arguments.file)
        figures["runs"] = [r for r in figures["runs"] if key_of(r) != key] + [run]
        write_file(arguments.file, figures)
        again.add(key)
        left -= 1
    for name in dict.fromkeys(key[0] for key in missing):
        measure.note(f"figures: {name} is not at hand: --capture {name}=POINTS,TRUTH")
    return left != 0  # nothing more to do


# ---- the pages ----

def alone(run):
    """Whether the run had the machine to itself: else its wall time says little."""
    return run["machine"]["load"] <= 0.5 * run["machine"]["cores"]


def text_of(cell, runs):
    if not isinstance(cell, Cell):
        return cell
    run = runs.get((cell.capture, cell.options))
    if not run or (cell.key == "wall_s" and not alone(run)):
        return "-"
    return shown(cell.key, run.get(cell.key))


def is_measured(line, runs):
    """Whether the file has one of the line's runs; a line without runs (heads, the published code) always stands."""
    cells = [cell for cell in line if isinstance(cell, Cell)]
    return not cells or any((cell.capture, cell.options) in runs for cell in cells)


def markdown(rows, runs):
    rows = [line for line in rows if is_measured(line, runs)]
    if len(rows) == 1:
        return ["Not measured yet."]
    lines = ["| " + " | ".join(text_of(cell, runs) for cell in line) + " |" for line in rows]
    lines.insert(1, "|" + "---|" * len(rows[0]))
    return lines


def origin_lines(figures):
    """What the runs were made with and on; one line for each version and machine."""
    kinds = {}
    for run in figures["runs"]:
        machine = run["machine"]
        kind = (run["version"], run["commit"], machine["cores"], machine["vectors"])
        kinds.setdefault(kind, set()).add(run["date"])
    return [f"neupig {version} (commit {commit}), {cores} cores with {vectors}, no GPU, {min(dates)}"
            + (f" to {max(dates)}" if len(dates) > 1 else "") + "."
            for (version, commit, cores, vectors), dates in sorted(kinds.items())]


def block_of(name, figures, runs):
    if name == "origin":
        return origin_lines(figures)
    if name not in TABLES:
        fail(f"there is no table {name}")
    return markdown(TABLES[name], runs)


def filled(page, figures):
    """The page's text with its tables as the file has them."""
    runs = {key_of(run): run for run in figures["runs"]}
    lines, inside = [], ""
    with open(os.path.join(TREE, page), encoding="utf-8") as text:
        for line in text.read().splitlines():
            if line == "<!-- end of figures -->":
                inside = ""
            if not inside:
                lines.append(line)
            if line.startswith("<!-- figures: "):
                inside = line[len("<!-- figures: "):-len(" -->")]
                lines += ["", *block_of(inside, figures, runs), ""]
    if inside:
        fail(f"{page}: no end of figures {inside}")
    return "\n".join(lines) + "\n"


def picture(figures):
    chosen = [{**run, "setting": run["options"] or "default"} for run in figures["runs"] if key_of(run) in PICTURED]
    return plot_explore.draw(chosen, "cpu_s", "CD", {name: what[0] for name, what in CAPTURES.items()})


def outputs(arguments):
    """{path: text} of all that is made from the file."""
    figures = read_file(arguments.file)
    made = {page: filled(page, figures) for page in PAGES if os.path.exists(os.path.join(TREE, page))}
    made[PICTURE] = picture(figures)
    return made


def write_pages(arguments):
    for path, text in outputs(arguments).items():
        with open(os.path.join(TREE, path), "w", encoding="utf-8") as out:
            out.write(text)


def check(arguments):
    wrong = 0
    for path, text in outputs(arguments).items():
        with open(os.path.join(TREE, path), encoding="utf-8") as file:
            if file.read() != text:
                print(f"{path} is not what {arguments.file} says; tools/figures.py --write-pages")
                wrong = 1
    return wrong


def parse_arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--write-pages", action="store_true", help="put the tables into the pages")
    parser.add_argument("--check", action="store_true", help="exit code 1 where a page differs from the file")
    parser.add_argument("--capture", action="append", default=[], metavar="NAME=POINTS[,TRUTH[,FRAMES]]",
                        help="where a capture of the tables lies: " + ", ".join(n for n, c in CAPTURES.items() if not c[1]))
    parser.add_argument("--work", default="figures", metavar="DIR", help="for made captures, runs and logs (figures/)")
    parser.add_argument("--table", default="", choices=("", *TABLES), help="only what this table needs")
    parser.add_argument("--only", action="append", default=[], metavar="NAME", help="only this capture; several times")
    parser.add_argument("--again", action="store_true", help="measure what the file has already, too")
    parser.add_argument("--at-most", type=int, default=-1, metavar="N", help="so many runs; exit code 3 when some are left")
    parser.add_argument("--file", default=os.path.join(TREE, FILE), metavar="FILE.json")
    parser.add_argument("--neupig", default=os.environ.get("NEUPIG", os.path.join(TREE, "build/neupig")), metavar="FILE")
    return parser.parse_args()


def main():
    arguments = parse_arguments()
    if arguments.check:
        return check(arguments)
    if arguments.write_pages:
        return write_pages(arguments)
    return 0 if measure_all(arguments) else 3


if __name__ == "__main__":
    sys.exit(main())

#!/usr/bin/env python3
"""The tables of the paper, measured on captures that are named, beside the paper's own numbers.

    tools/paper_tables.py --capture dancer=POINTS,TRUTH --capture horse=POINTS,TRUTH,0:48:2 --quick
    tools/paper_tables.py --capture dancer=POINTS,TRUTH --only lengths --only noise
    tools/paper_tables.py --capture dancer=POINTS,TRUTH --list
    tools/paper_tables.py --write-page
    tools/paper_tables.py --check

The rows stand in tools/paper_rows.py.  The first command measures those that the results file does not have yet, the cheapest
first, and writes each into the file as it ends; stopped or killed, the same command resumes, in the middle of a run where
that run has a state.  A run that fails is a row with its error.  Without --capture a walking figure is made (neupig synth).  --quick takes smaller meshes and fewer
epochs.  --list measures nothing and says what would be, with estimates of time.  The last two write the page from the file,
or fail where it is not what the file says (exit code 1).  Points of rows with another number of points or with noise are
sampled here on the true meshes (PLY or OBJ).  Needs Python 3 alone.
"""
import argparse
import fcntl
import hashlib
import json
import os
import re
import shlex
import shutil
import statistics
import subprocess
import sys

import measure
import sample_points
from paper_rows import SIZES, TABLES

TREE = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
FILE = "samples/guide/paper_tables.json"
WALKER = ("walker", "--frames 120 --points 5000 --cycles 6")
POINTS = 5000  # a frame, where a row asks for noise alone
SAME = 1.05    # factors below count as no difference, unless other seeds differ more
TITLES = {"CD": "CD", "NC": "NC", "F": "F-0.5 %", "Corr": "Corr", "cpu_s": "s"}
FORMATS = {"CD": "{:.2f}", "NC": "{:.3f}", "F": "{:.3f}", "Corr": "{:.4f}", "cpu_s": "{:.0f}"}
OF_PAPER = {**FORMATS, "Corr": "{:.3f}"}  # as many digits as it has
COMPARED = ("CD", "Corr")

# ---- what is to be run ----


def fail(text):
    sys.exit(f"paper_tables: {text}")


class Capture:
    """Points and truth of frames first, first + step ...; count of them."""

    def __init__(self, name, points, truth, frames, count):
        self.name, self.points, self.truth = name, points, truth
        match = re.fullmatch(r"(\d*):(\d*)(?::(\d+))?", frames or ":")
        if not match:
            fail(f"--capture {name}: frames {frames}: wanted A:B or A:B:STEP")
        chosen = range(count)[slice(*(int(text) if text else None for text in match.groups()))]
        self.first, self.step, self.count = chosen.start, chosen.step, len(chosen)

    def selection(self, frames):
        """The first so many of the frames, as neupig run --frames has them."""
        end = self.first + frames * self.step
        return f"{self.first}:{end}" + (f":{self.step}" if self.step > 1 else "")


def mesh_files(folder):
    """Files of a folder of true meshes in the order of the numbers in their names."""
    try:
        names = [name for name in os.listdir(folder) if name.endswith((".ply", ".obj"))]
    except OSError as error:
        fail(f"{folder}: {error.strerror}")
    return [os.path.join(folder, name)
            for name in sorted(names, key=lambda n: [int(t) if t.isdigit() else t for t in re.split(r"(\d+)", n)])]


def captures_of(arguments):
    """{name: capture}; without any the walking figure, whose files are made when they are needed."""
    found = {}
    for text in arguments.capture:
        name, points, truth, frames = measure.parse_capture(text, fail)
        if not truth:
            fail(f"--capture {text}: no truth to compare with")
        found[name] = Capture(name, points, truth, frames, len(mesh_files(truth)))
    if not found:
        folder = os.path.join(arguments.work, WALKER[0])
        found[WALKER[0]] = Capture(WALKER[0], os.path.join(folder, "points"), os.path.join(folder, "truth"), "", 120)
    return found


def make_walker(arguments):
    if not arguments.capture:
        measure.synth(arguments.neupig, os.path.join(arguments.work, WALKER[0]), shlex.split(WALKER[1]))


def epochs_of(row, size, arguments):
    return round(row.epochs * SIZES[size].share) if row.epochs else arguments.epochs or SIZES[size].epochs


def options_of(row, size, arguments):
    """Of the whole run.  What the preset has anyway is left out, so that equal runs have equal options."""
    own = row.options.replace("--rotation quaternion", "").replace("--smoothing doubled", "")
    epochs = f"--epochs {epochs_of(row, size, arguments)}" if row.preset == "paper" else ""
    return " ".join(f"--preset {row.preset} {epochs} {SIZES[size].options} {own} {arguments.options}".split())


def key_of_row(row, table, size, capture, arguments):
    """What a run is known by: (capture, frames, points, noise, options)."""
    is_made = row.points or row.noise is not None
    return (capture, row.frames or table.frames, (row.points or POINTS) if is_made else 0, row.noise or 0,
            options_of(row, size, arguments))


def key_of(run):
    return run["capture"], run["frames"], run["points"], run["noise"], run["options"]


def number_after(option, options, default):
    words = options.split()
    return float(words[words.index(option) + 1]) if option in words else default


def estimate(key):
    """Processor seconds: the decoder at the rate of a core with AVX-512, and what a vertex costs besides."""
    _, frames, points, _, options = key
    if "--preset paper" not in options:
        return 5 + 2.5 * frames
    verts = min(number_after("--faces", options, 20000), 4 * (points or POINTS)) / 2
    first, second = number_after("--width-1", options, 512), number_after("--width-2", options, 512)
    layers = number_after("--hidden-layers", options, 2)
    between = (first + (layers - 2) * second) * second if layers > 1 else 0
    flops = 6 * (40 * first + between + 7 * (second if layers > 1 else first))
    return 5 + frames * number_after("--epochs", options, 250) * verts * (flops / 2.25e11 + 9.4e-6)


def unknown_options(options, known):
    preset = " ".join(options.split()[:2])
    return [word for word in [preset, *options.split()[2:]] if word.startswith("--") and word not in known]


def known_options(neupig):
    """Options and presets of neupig run; a row with one that it does not have is of another version, and not run."""
    def shown(subject):
        return subprocess.run([neupig, "help", subject], check=True, stdout=subprocess.PIPE, text=True).stdout

    text = shown("method")
    presets = [line.split()[0] for line in text.partition("Names:\n")[2].partition("\n\n")[0].splitlines()]
    options = {"--" + key for key in re.findall(r"^  ([a-z][a-z0-9-]*)", text.partition("Keys")[2], re.M)}
    options |= set(re.findall(r"--[a-z][a-z0-9-]*", shown("run")))
    return options | {"--no-" + option[2:] for option in options} | {f"--preset {name}" for name in presets}


def plan(arguments, captures):
    """{key: (tables, why it can't be run)}, in the order of the tables; each run once."""
    size, planned, known = size_of(arguments), {}, known_options(arguments.neupig)
    for name in arguments.only or TABLES:
        for capture in captures.values():
            for row in TABLES[name].rows:
                if not row.is_run:
                    continue
                key = key_of_row(row, TABLES[name], size, capture.name, arguments)
                missing = unknown_options(key[4], known)
                why = f"this neupig has no {missing[0]}" if missing else ""
                if key[1] > capture.count:
                    why = f"{capture.name} has {capture.count} frames"
                planned.setdefault(key, ([], why))[0].append(f"{name}: {row.label}")
    return planned


def size_of(arguments):
    return "quick" if arguments.quick else "full"


# ---- the file ----


def read_file(path):
    if not os.path.exists(path):
        return []
    with open(path, encoding="utf-8") as file:
        return json.load(file)["runs"]


def write_file(path, runs):
    """A line for every run, so that changes can be read; whole or not at all."""
    lines = ["{", ' "about": "Measured by tools/paper_tables.py; units as in neupig eval, lengths in diagonals of the box",']
    lines.append(' "runs": [\n  ' + ",\n  ".join(json.dumps(run) for run in sorted(runs, key=key_of)) + "\n ]\n}\n")
    with open(path + ".part", "w", encoding="utf-8") as out:
        out.write("\n".join(lines))
        out.flush()
        os.fsync(out.fileno())
    os.replace(path + ".part", path)


# ---- measuring ----


def made_capture(arguments, capture, key):
    """A folder with sampled points and with links to the true meshes they lie on."""
    name = f"{capture.name}-{key[1]}x{key[2]}-noise{key[3]}"
    folder = os.path.join(arguments.work, "made", name)
    if os.path.isdir(folder):
        return name, folder
    shutil.rmtree(folder + ".part", ignore_errors=True)
    for part in ("points", "truth"):
        os.makedirs(os.path.join(folder + ".part", part))
    deviation = 0
    for i in range(key[1]):
        path = mesh_files(capture.truth)[capture.first + i * capture.step]
        verts, faces = sample_points.read_mesh(path)
        deviation = deviation if i else key[3] / 100 * sample_points.diagonal(verts)
        place = f"{i:04d}{os.path.splitext(path)[1]}"
        os.symlink(os.path.abspath(path), os.path.join(folder + ".part", "truth", place))
        cloud = sample_points.sample(verts, faces, key[2], deviation, f"{name} {i}")
        sample_points.write_points(os.path.join(folder + ".part", "points", f"{i:04d}.ply"), cloud)
    os.replace(folder + ".part", folder)
    return name, folder


def input_of(arguments, capture, key):
    """(name, points, truth, frames) of a run."""
    if not key[2]:
        return capture.name, capture.points, capture.truth, capture.selection(key[1])
    name, folder = made_capture(arguments, capture, key)
    return name, os.path.join(folder, "points"), os.path.join(folder, "truth"), ""


def error_of(log, code):
    """What a run that failed said last."""
    with open(log, encoding="utf-8", errors="replace") as file:
        lines = [line.strip() for line in file if line.strip()]
    return f"exit code {code}: {lines[-1] if lines else 'it said nothing'}"


def run_folder(arguments, key, origin):
    """(folder, whether a run of this very key and command was stopped in it)."""
    name = hashlib.sha256(json.dumps(key).encode()).hexdigest()[:16]
    folder = os.path.join(arguments.work, "runs", name)
    mark = {"key": key, "version": origin["version"], "commit": origin["commit"]}
    mark_text = json.dumps(mark)
    try:
        with open(folder + ".json", encoding="utf-8") as file:
            is_same = file.read() == mark_text
    except OSError:
        is_same = False
    if is_same and os.path.isdir(os.path.join(folder, "job")):
        return folder, True
    shutil.rmtree(folder, ignore_errors=True)
    os.makedirs(os.path.dirname(folder), exist_ok=True)
    with open(folder + ".json", "w", encoding="utf-8") as file:
        file.write(mark_text)
    return folder, False


def timed_run(arguments, command, folder, is_resumed):
    """A state that can't be resumed is discarded, and the run made from its start."""
    log = folder + ".log"
    with open(log, "w", encoding="utf-8"):
        pass
    result = measure.timed(command, log)
    if is_resumed and result["exit_code"] not in (0, 7, 75):
        shutil.rmtree(folder, ignore_errors=True)
        return timed_run(arguments, command, folder, False)
    return {**result, "resumed": True} if is_resumed else result


def measure_run(arguments, capture, key):
    """The line of the file for this key, or None where the run was stopped by a signal."""
    run = dict(zip(("capture", "frames", "points", "noise", "options"), key))
    name, points, truth, frames = input_of(arguments, capture, key)
    chosen = ["--frames", frames] if frames else []
    run["command"] = " ".join(["neupig run", name, "-o OUT", *chosen, key[4]])
    run.update(measure.source(arguments.neupig))
    run["machine"] = measure.machine()
    folder, is_resumed = run_folder(arguments, key, run)
    command = [arguments.neupig, "run", points, "-o", folder, "--quiet", *chosen, *key[4].split()]
    run.update(timed_run(arguments, command, folder, is_resumed))
    if run["exit_code"] == 75:
        return None
    if run["exit_code"] in (0, 7):
        run.update(measure.explains(folder))
        run.update(measure.compare(arguments.neupig, folder, truth, frames))
    else:
        run["error"] = error_of(folder + ".log", run["exit_code"])
    shutil.rmtree(folder, ignore_errors=True)
    return run


def to_run(arguments, planned):
    """Keys that are not measured, the cheapest first."""
    measured = {key_of(run) for run in read_file(arguments.file) if not (arguments.retry and "error" in run)}
    keys = [key for key, (_, why) in planned.items() if not why and (arguments.again or key not in measured)]
    return sorted(keys, key=estimate)


def attempt(arguments, capture, key):
    """measure_run, with what goes wrong outside of the run itself as an error, too."""
    try:
        return measure_run(arguments, capture, key)
    except (OSError, ValueError, KeyError, subprocess.CalledProcessError) as error:
        run = dict(zip(("capture", "frames", "points", "noise", "options"), key))
        return {**run, "command": "neupig run", **measure.source(arguments.neupig), "machine": measure.machine(),
                "error": f"{type(error).__name__}: {error}"}


def measure_all(arguments):
    captures = captures_of(arguments)
    os.makedirs(arguments.work, exist_ok=True)
    with open(os.path.join(arguments.work, "lock"), "w", encoding="utf-8") as lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            fail(f"{arguments.work} is in use by another tools/paper_tables.py")
        make_walker(arguments)
        return measure_keys(arguments, captures, to_run(arguments, plan(arguments, captures)))


def measure_keys(arguments, captures, keys):
    failed = 0
    for i, key in enumerate(keys if arguments.at_most < 0 else keys[:arguments.at_most], 1):
        measure.note(f"paper_tables: {i} of {len(keys)}: {key[0]}, {key[1]} frames, "
                     + (f"{key[2]} points, {key[3]} % noise, " if key[2] else "") + key[4])
        run = attempt(arguments, captures[key[0]], key)
        if not run:
            fail("stopped; the same command resumes")
        if "error" in run:
            measure.note(f"paper_tables: failed: {run['error']}")
            failed = 1
        write_file(arguments.file, [r for r in read_file(arguments.file) if key_of(r) != key] + [run])
        write_page(arguments)
    return failed


def pace(runs):
    """How much longer than estimated the runs of the file took on this kind of machine."""
    shares = [run["cpu_s"] / estimate(key_of(run)) for run in runs
              if run.get("CD") is not None and "resumed" not in run and run["machine"]["cores"] == measure.machine()["cores"]]
    return statistics.median(shares) if shares else 1


def list_plan(arguments):
    runs = read_file(arguments.file)
    measured = {key_of(run): "failed" if "error" in run else "measured" for run in runs}
    planned = plan(arguments, captures_of(arguments))
    left, scale = set(to_run(arguments, planned)), pace(runs) / measure.machine()["cores"]
    for key, (rows, why) in planned.items():
        state = why or (f"{scale * estimate(key):.0f} s" if key in left else measured[key])
        for row in rows:
            print(f"{key[0]:<12} {key[1]:>4} frames  {row:<52} {state}")
    total = sum(scale * estimate(key) for key in left)
    print(f"{len(left)} runs to make of {len(planned)}, about {total / 60:.0f} minutes on {measure.machine()['cores']} cores")


# ---- the page ----


def found_run(runs, row, table, size, capture, arguments):
    return runs.get(key_of_row(row, table, size, capture, arguments)) if row.is_run else None


def shown(figures, key, formats):
    value = figures.get(key)
    return "-" if value is None or (key == "cpu_s" and figures.get("resumed")) else formats[key].format(value)


def cells_of(run, keys):
    if not run:
        return ["-"] * len(keys)
    if "error" in run:
        return ["failed: " + run["error"].replace("|", "/")] + ["-"] * (len(keys) - 1)
    return [shown(run, key, FORMATS) for key in keys]


def markdown(rows):
    lines = ["| " + " | ".join(line) + " |" for line in rows]
    return [lines[0], "|" + "---|" * len(rows[0])] + lines[1:] + [""]


def table_lines(table, names, found):
    """Absolute figures: the paper's, then those of every capture."""
    heads = [""] + ["paper: " + TITLES[table.keys[0]]] + [TITLES[key] for key in table.keys[1:]]
    for name in names:
        heads += [f"{name}: {TITLES[table.keys[0]]}"] + [TITLES[key] for key in table.keys[1:]]
    rows = [heads]
    for row in table.rows:
        if row.is_run and not any(found[row, name] for name in names):
            continue
        cells = [row.label] + [shown(row.paper, key, OF_PAPER) for key in table.keys]
        for name in names:
            cells += cells_of(found[row, name], table.keys)
        rows.append(cells)
    return markdown(rows)


def factor(figures, base, key):
    """How many times the figure of the row that this one is compared with; None where one is not there."""
    value, against = (figures or {}).get(key), (base or {}).get(key)
    return value / against if value is not None and against else None


def kind_of(value, margin):
    return "more" if value > margin else "less" if value < 1 / margin else "same"


def base_of(row, table):
    return next((other for other in table.rows if other.is_base and other.group == row.group), None)


def margin_of(seed_runs, key):
    """Below this factor two runs count as equal: what other seeds make of the same run, and SAME at least."""
    values = [run[key] for run in seed_runs if run and run.get(key)]
    return max([SAME] + [max(values) / min(values)] if values else [SAME])


class Comparison:
    """Which differences of the paper a table shows here, too."""

    def __init__(self):
        self.alike, self.all = 0, 0

    def cell(self, paper, own, margin):
        """The factor as text; bold where the paper's row is better, worse or equal, and this one, clearly, is not."""
        if own is None:
            return "-"
        text = f"{own:.2f}"
        if paper is None:
            return text
        is_alike = kind_of(paper, margin) == kind_of(own, margin) or kind_of(paper / own, margin) == "same"
        self.all += 1
        self.alike += is_alike
        return text if is_alike else f"**{text}**"


def compare_table(table, names, found, margins):
    """(lines, comparison): factors against the row that stands for the paper's method."""
    comparison, rows = Comparison(), [["against"] + [f"{who}: {key}" for key in COMPARED for who in ("paper", *names)]]
    for row in table.rows:
        base = base_of(row, table)
        own = [found[row, name] for name in names]
        if not base or not row.is_run or not any(own) or own == [found[base, name] for name in names]:
            continue
        cells = []
        for key in COMPARED:
            paper = factor(row.paper, base.paper, key)
            cells.append("-" if paper is None else f"{paper:.2f}")
            cells += [comparison.cell(paper, factor(found[row, name], found[base, name], key), margins[name, key])
                      for name in names]
        if any(cell != "-" for cell in cells[1:len(names) + 1]):
            rows.append([f"{row.label}, to {base.label}", *cells])
    return (markdown(rows) if len(rows) > 1 else []), comparison


def table_block(table, size, runs, names, arguments):
    """(lines, comparison) of one table, of the captures of which it has two runs at least."""
    found = {(row, name): found_run(runs, row, table, size, name, arguments) for row in table.rows for name in names}
    names = [name for name in names if len({id(found[row, name]) for row in table.rows if found[row, name]}) > 1]
    if not names:
        return [], None
    seeds = TABLES["seeds"]
    margins = {(name, key): margin_of([found_run(runs, row, seeds, size, name, arguments) for row in seeds.rows], key)
               for name in names for key in COMPARED}
    lines = [f"### {table.title}", "", table.about, ""] + table_lines(table, names, found)
    compared, comparison = compare_table(table, names, found, margins)
    if comparison.all:
        lines += [f"In {comparison.alike} of {comparison.all} comparisons as in the paper.", ""]
    return lines + compared, comparison


def size_block(size, runs, arguments):
    names = list(dict.fromkeys(key[0] for key in runs))
    blocks = {name: table_block(table, size, runs, names, arguments) for name, table in TABLES.items()}
    body = [line for lines, _ in blocks.values() for line in lines]
    if not body:
        return []
    summary = [["table", "as in the paper"]] + [
        [TABLES[name].title, f"{comparison.alike} of {comparison.all}"]
        for name, (_, comparison) in blocks.items() if comparison and comparison.all]
    what = SIZES[size]
    lines = [f"## {what.title}", "", f"`--epochs {arguments.epochs or what.epochs}`, where the row names no other"
             + (f" (those it names, times {what.share}), and `{what.options}`." if what.options else "."), ""]
    return lines + (markdown(summary) if len(summary) > 1 else []) + body


def origin_lines(runs):
    """What the runs were made with and on."""
    kinds = {}
    for run in runs.values():
        kind = (run["version"], run["commit"], run["machine"]["cores"], run["machine"]["vectors"])
        kinds.setdefault(kind, []).append(run["date"])
    return [f"- neupig {version} (commit {commit}), {cores} cores with {vectors}: {len(dates)} runs, {min(dates)}"
            + (f" to {max(dates)}" if max(dates) != min(dates) else "")
            for (version, commit, cores, vectors), dates in sorted(kinds.items())]


PAGE_HEAD = """# The paper's tables

Made by `tools/paper_tables.py` from [NAME](NAME); a line there is one run with its command, version and machine. Captures differ
from the paper's, so absolute figures can't be compared; what a change makes of them can. CD is the Chamfer distance x 1e5, NC normal
consistency, F-0.5 % the F-score, Corr the correspondence error, as `neupig eval` has them.

Under each table stand CD and Corr as factors of the row that is the paper's method. Bold: the paper's row is worse, better or equal
and ours, by more than the slack, is not. The slack is 1.05, or what other seeds make of the same run (table Seeds).

Rows that were not measured are not shown, nor tables with one run alone. What there is, with estimates of time:

```sh
tools/paper_tables.py --list --quick
```

It makes a walking figure for itself. With captures of your own the tables are measured into a file and a page beside it; the same
command adds what is missing, and resumes when it was stopped:

<!-- not run: takes most of an hour, and needs captures that are not in the source tree -->
```sh
tools/paper_tables.py --capture dancer=POINTS,TRUTH --capture horse=POINTS,TRUTH --quick --file mine.json
tools/paper_tables.py --capture dancer=POINTS,TRUTH --only lengths --only stability
```
"""


def page_of(arguments):
    runs = {key_of(run): run for run in read_file(arguments.file)}
    head = PAGE_HEAD.replace("NAME", os.path.basename(arguments.file)).splitlines()
    lines = [line for size in SIZES for line in size_block(size, runs, arguments)]
    if not lines:
        lines = ["Nothing is measured yet.", ""]
    return "\n".join(head + [""] + lines + (["## Measured with", "", *origin_lines(runs)] if runs else [])).rstrip() + "\n"


def page_path(arguments):
    return os.path.splitext(arguments.file)[0] + ".md"


def write_page(arguments):
    with open(page_path(arguments), "w", encoding="utf-8") as out:
        out.write(page_of(arguments))


def check(arguments):
    with open(page_path(arguments), encoding="utf-8") as file:
        if file.read() == page_of(arguments):
            return 0
    print(f"{page_path(arguments)} is not what {arguments.file} says; tools/paper_tables.py --write-page")
    return 1


def parse_arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--capture", action="append", default=[], metavar="NAME=POINTS,TRUTH[,FRAMES]",
                        help="a capture with its true meshes; FRAMES is A:B or A:B:STEP; a row takes the first so many of them")
    parser.add_argument("--only", action="append", default=[], choices=list(TABLES), metavar="TABLE",
                        help="only this table, several times: " + ", ".join(TABLES))
    parser.add_argument("--quick", action="store_true", help="smaller meshes, fewer epochs: " + SIZES["quick"].options)
    parser.add_argument("--epochs", type=int, default=0, metavar="N", help="of rows that name none (250; 100 with --quick)")
    parser.add_argument("--options", default="", metavar="'OPTIONS'", help="more options of every run of neupig run")
    parser.add_argument("--list", action="store_true", help="say what would be run, with estimates of time")
    parser.add_argument("--retry", action="store_true", help="run again what failed")
    parser.add_argument("--again", action="store_true", help="run again what is measured, too")
    parser.add_argument("--at-most", type=int, default=-1, metavar="N", help="so many runs")
    parser.add_argument("--write-page", action="store_true", help="write the page from the file")
    parser.add_argument("--check", action="store_true", help="exit code 1 where the page is not what the file says")
    parser.add_argument("--work", default="paper-tables", metavar="DIR", help="for made points, runs and logs (paper-tables/)")
    parser.add_argument("--file", default=os.path.join(TREE, FILE), metavar="FILE.json", help="results; the page lies beside it")
    parser.add_argument("--neupig", default=os.environ.get("NEUPIG", os.path.join(TREE, "build/neupig")), metavar="FILE")
    return parser.parse_args()


def main():
    arguments = parse_arguments()
    if arguments.check:
        return check(arguments)
    if arguments.write_page:
        return write_page(arguments)
    if arguments.list:
        return list_plan(arguments)
    return measure_all(arguments)


if __name__ == "__main__":
    try:
        sys.exit(main())
    except KeyboardInterrupt:
        sys.exit("paper_tables: stopped; the same command resumes")

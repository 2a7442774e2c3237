#!/usr/bin/env python3
"""The bed: many very short captures, run with a change and without it, and what the change moved by more than noise.

    bed.py run --variant NAME [--exe NEUPIG] [--args "OPTIONS OF RUN"]     a row for each capture in ROWS
    bed.py compare A B                                                     what differs, of two variants
    bed.py constants --room ROOM [--scales 0.7,1.4]                        a room's tuned constants, file by file
    bed.py list                                                            the captures

Captures are made once and kept in --folder (build/bed), beside rows/NAME.jsonl and the trees that `constants` builds; rows that
are there already are not run again.  --bed small takes SMALL of the captures and one seed, --only TEXT those whose name has
that text in it.  --data names a folder with NAME.npz (verts, faces) of more bodies; these take numpy and are left out without.
README.md, beside this script, says what the figures mean and how long it takes.
"""

import argparse
import concurrent.futures
import json
import math
import os
import pathlib
import re
import shlex
import shutil
import statistics
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent
sys.path.insert(0, str(ROOT / "tests" / "structure"))
sys.path.insert(0, str(pathlib.Path(__file__).parent))

SENSORS = {
    "clean": [],
    "noise": ["--noise", "0.2", "--outliers", "1", "--no-normals"],
    "cam3": ["--cameras", "3", "--no-normals"],
    "cam4n": ["--cameras", "4", "--noise", "0.1", "--no-normals"],
    "cam1": ["--cameras", "1", "--no-normals"],
    "holes": ["--noise", "0.1", "--holes", "5"],
}
# A body of neupig-bodies (tests/README.md) with its options, or one of --data with its frames; and what sees it.
BODIES = {
    "walker": (["--body", "walker", "--cycles", "0.5"], "clean noise cam3 cam4n cam1 holes"),
    "runner": (["--body", "walker", "--cycles", "1.5", "--travel", "0.5"], "clean noise cam3"),
    "bar": (["--body", "bar", "--cycles", "0.4"], "clean noise"),
    "hands": (["--body", "hands"], "clean noise"),
    "samba0": (("samba", 0, 2), "clean noise cam3 cam4n cam1"),
    "samba60": (("samba", 60, 2), "clean noise cam3 cam4n holes"),
    "samba140": (("samba", 140, 2), "clean noise cam4n"),
    "horse": (("horse-gallop", 0, 1), "clean noise cam3 cam4n holes"),
    "chicken": (("chicken", 150, 2), "clean noise"),
}
CAPTURES = [f"{body}.{sensor}" for body, (_, sensors) in BODIES.items() for sensor in sensors.split()]
SMALL = ["walker.noise", "runner.clean", "walker.cam3", "samba60.clean", "samba140.cam4n", "horse.noise"]

FIGURES = ("CD", "NC", "Corr", "cpu")  # compared by their ratio; of NC what is missing to 1
MOVED = 3.0  # standard errors: a change of nothing passes that in one of some hundred figures
LEAST = 0.002  # of a figure: whoever repeats a run with other threads of Poisson's sees that much


# ---- captures ----

def call(*command):
    done = subprocess.run([str(word) for word in command], capture_output=True, text=True, check=False)
    if done.returncode:
        raise RuntimeError(f"{shlex.join(str(word) for word in command)}: {(done.stdout + done.stderr).strip()[-500:]}")
    return done.stdout


def make_capture(options, name, seed):
    """The folder of a capture: points/ and truth/, made where it is not there yet."""
    body, sensor = name.split(".")
    folder = options.folder / "captures" / f"{name}-{options.frames}x{options.points}-{seed}"
    if folder.is_dir():
        return folder
    folder.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=folder.parent) as scratch:
        made = pathlib.Path(scratch) / "made"
        source = BODIES[body][0]
        shared = ["--frames", options.frames, "--points", options.points, "--seed", seed, *SENSORS[sensor]]
        if isinstance(source, list):
            call(options.bodies, "-o", made, "--cell", "0.04", *source, *shared)
        else:
            call(sys.executable, pathlib.Path(__file__).with_name("sampled.py"), options.data / f"{source[0]}.npz", made,
                 "--start", source[1], "--step", source[2], *shared)
        made.rename(folder)
    return folder


def find_there(options, names):
    """Those of the captures that can be made here; says which can't."""
    there = []
    for name in names:
        source = BODIES[name.split(".")[0]][0]
        if isinstance(source, list) or (options.data and (options.data / f"{source[0]}.npz").is_file() and has_numpy()):
            there.append(name)
    if len(there) < len(names):
        print(f"left out, no data or no numpy: {' '.join(name for name in names if name not in there)}", file=sys.stderr)
    return there


def has_numpy():
    try:
        import numpy  # noqa: F401
        return True
    except ImportError:
        return False


# ---- runs ----

def run_one(options, name, seed):
    """The row of one run."""
    capture = make_capture(options, name, seed)
    row = {"capture": name, "seed": seed}
    with tempfile.TemporaryDirectory(dir=options.folder) as scratch:
        out = pathlib.Path(scratch) / "out"
        command = [options.exe, "run", capture / "points", "-o", out, "--faces", options.faces, "--quiet", *shlex.split(options.args)]
        with open(pathlib.Path(scratch) / "log", "w") as log:
            process = subprocess.Popen([str(word) for word in command], stdout=log, stderr=log)
        _, status, used = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
        row.update(exit=process.returncode, cpu=round(used.ru_utime + used.ru_stime, 2))
        if process.returncode in (0, 7):
            lines = (out / "frames.jsonl").read_text().splitlines()
            row["good"] = sum('"good":true' in line for line in lines)
            told = json.loads(call(options.exe, "eval", out, capture / "truth", "--samples", 20000, "--json"))
            row.update({key: told[key] for key in ("CD", "NC", "F", "Corr")})
    return row


def read_rows(options, variant):
    path = options.folder / "rows" / f"{variant}.jsonl"
    rows = [json.loads(line) for line in path.read_text().splitlines()] if path.exists() else []
    return {(row["capture"], row["seed"]): row for row in rows}


def run_variant(options, variant):
    """Runs what is missing of a variant; all of its rows of this bed."""
    path = options.folder / "rows" / f"{variant}.jsonl"
    path.parent.mkdir(parents=True, exist_ok=True)
    rows = read_rows(options, variant)
    wanted = [(name, seed) for seed in options.seeds for name in options.captures]
    with concurrent.futures.ThreadPoolExecutor(options.jobs) as pool:
        jobs = [pool.submit(run_one, options, *key) for key in wanted if key not in rows]
        for job in concurrent.futures.as_completed(jobs):
            row = job.result()
            rows[row["capture"], row["seed"]] = row
            with path.open("a") as file:
                file.write(json.dumps(row) + "\n")
            if not options.is_quiet:
                print(text_of(row), flush=True)
    return {key: rows[key] for key in wanted}


def text_of(row):
    figures = "  ".join(f"{key} {row[key]:.4g}" for key in FIGURES if row.get(key) is not None)
    return f"{row['capture']:16} seed {row['seed']}  exit {row['exit']}  good {row.get('good', 0)}  {figures}"


# ---- what moved ----

def log_of(row, figure):
    """The logarithm of a figure of which less is better; None where there is none."""
    value = row.get(figure)
    if value is None:
        return None
    value = 1 - value if figure == "NC" else value
    return math.log(value) if value > 0 else None


def spread_of(groups):
    """{capture: deviation of a single value} of {capture: values}: its own over the seeds, but no less than the median of the
    captures together, since that of three values is often small by chance.  None where no capture has several."""
    own = {name: statistics.stdev(values) for name, values in groups.items() if len(values) > 1}
    if not own:
        return None
    usual = statistics.median(own.values())
    return {name: max(own.get(name, usual), usual, LEAST) for name in groups}


def differences(before, after, figure):
    """{sensor: {capture: [log ratio of each seed]}}"""
    found = {}
    for key in sorted(before.keys() & after.keys()):
        a, b = log_of(before[key], figure), log_of(after[key], figure)
        if a is not None and b is not None:
            found.setdefault(key[0].split(".")[1], {}).setdefault(key[0], []).append(b - a)
    return found


def noise_of(before, after, figure, sensor, groups):
    """{capture: deviation of one difference that chance alone makes}: of the seeds' differences where there are several seeds on
    both sides, else what the seeds of one side differ by, which is more.  With one seed everywhere it is not known, and LEAST."""
    paired = spread_of(groups)
    if paired:
        return paired
    for side in (before, after):
        values = {}
        for (name, _), row in side.items():
            value = log_of(row, figure)
            if name.split(".")[1] == sensor and value is not None:
                values.setdefault(name, []).append(value)
        spread = spread_of(values)
        if spread:
            return spread
    return dict.fromkeys(groups, LEAST)


def moved_figures(before, after):
    """(where, figure, change, standard error, has it moved) for each capture, each kind of sensor, and all."""
    for figure in FIGURES:
        everything = []
        for sensor, groups in differences(before, after, figure).items():
            noise = noise_of(before, after, figure, sensor, groups)
            means = [(statistics.fmean(values), noise[name] / math.sqrt(len(values))) for name, values in groups.items()]
            for name, (mean, error) in zip(groups, means):
                yield name, figure, mean, error, abs(mean) > MOVED * error
            everything += means
            yield (f"all {sensor}", figure, *together(means))
        if everything:
            yield ("all", figure, *together(everything))


def together(means):
    """The mean of several captures, each by what its noise leaves it to say, and the error of that."""
    weight = sum(error ** -2 for _, error in means)
    mean, error = sum(mean * error ** -2 for mean, error in means) / weight, weight ** -0.5
    return mean, error, abs(mean) > MOVED * error


def changed_verdicts(before, after):
    """(capture, seed, before, after) where the exit code is another one, or another number of frames is good."""
    for key in sorted(before.keys() & after.keys()):
        a, b = before[key], after[key]
        if a["exit"] != b["exit"] or a.get("good") != b.get("good"):
            yield (*key, f"exit {a['exit']} good {a.get('good')}", f"exit {b['exit']} good {b.get('good')}")


def percent(logarithm):
    return 100 * math.expm1(logarithm)


def show_comparison(before, after, is_all):
    count = 0
    for where, figure, mean, error, has_moved in moved_figures(before, after):
        is_sum = where.startswith("all")
        count += has_moved and figure != "cpu"
        if has_moved or is_all or where == "all":
            name = "1 - NC" if figure == "NC" else figure
            print(f"{where:18} {name:6} {percent(mean):+8.2f} %  noise {percent(error):6.2f} %  "
                  f"{'moved' if has_moved else 'within noise'}{' (sum)' if is_sum else ''}")
    for name, seed, a, b in changed_verdicts(before, after):
        print(f"{name:18} seed {seed}: {a} -> {b}")
        count += 1
    print(f"{count} moved" if count else "nothing moved by more than noise")
    return count


# ---- constants ----

def scaled(text, scale):
    """A number times the scale.  It stays whole, and on its side of 1, where most have their meaning."""
    value = float(text)
    if re.fullmatch(r"-?\d+", text):
        moved = round(value * scale)
        if moved == value:
            moved += 1 if scale > 1 else -1
        return str(max(moved, 1)) if value >= 1 else str(moved)
    moved = value * scale
    if 0 < value < 1 <= moved or 1 < value and moved <= 1:
        moved = (1 + value) / 2
    return f"{moved:.6g}" if re.search(r"[.e]", f"{moved:.6g}") else f"{moved:.6g}.0"


def scale_file(path, found, scale):
    """Writes the file with its constants scaled."""
    lines = path.read_text().split("\n")
    for number, name, text in found:
        at = lines[number - 1].index(name) + len(name)
        head, tail = lines[number - 1][:at], lines[number - 1][at:]
        if tail.strip() == "\\":  # the number stands on the next line
            lines[number] = lines[number].replace(text, scaled(text, scale), 1)
            continue
        lines[number - 1] = head + tail.replace(text, scaled(text, scale), 1)
    path.write_text("\n".join(lines))


def copy_tree(options):
    """A copy of the tree to build in; what has not changed is not touched, so that little is built again."""
    tree = options.folder / "tree"
    for name in call("git", "-C", ROOT, "ls-files", "-co", "--exclude-standard").splitlines():
        source, target = ROOT / name, tree / name
        if source.is_file() and (not target.is_file() or source.read_bytes() != target.read_bytes()):
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(source, target)
    return tree


def build(tree):
    if not (tree / "build" / "build.ninja").exists():
        call("cmake", "--preset", "release", "-S", tree)
    call("cmake", "--build", tree / "build", "--target", "neupig", "neupig-poisson")
    return tree / "build" / "neupig"


def constants_by_file(room, only):
    import constants
    files = {}
    for of_room, place, name, text in constants.read_constants(ROOT):
        file, number = place.rsplit(":", 1)
        if of_room == room and only in file:
            files.setdefault(file, []).append((int(number), name, text))
    return files


def judge_constants(options):
    """A line for each file and scale; then which files are within noise both ways."""
    base = read_rows(options, options.base)
    missing = [name for name in options.captures for seed in options.seeds if (name, seed) not in base]
    if missing:
        sys.exit(f"first: bed.py run --variant {options.base} --seeds 1,2,3 (no rows of {' '.join(missing)})")
    tree = copy_tree(options)
    for file, found in constants_by_file(options.room, options.files).items():
        original, moved = (tree / file).read_text(), 0
        for scale in options.scales:
            try:
                scale_file(tree / file, found, scale)
                options.exe = build(tree)
                after = run_variant(options, f"{file.replace('/', '_')}-x{scale:g}")
                print(f"\n{file} x {scale:g} ({len(found)} constants: {' '.join(name for _, name, _ in found)})")
                moved += show_comparison(base, after, False)
            except RuntimeError as failure:
                print(f"{file} x {scale:g}: {failure}")
                moved += 1
            finally:
                (tree / file).write_text(original)
        print(f"== {file}: {'outside noise' if moved else 'WITHIN NOISE'}", flush=True)


# ---- the command ----

def parse():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("verb", choices=("run", "compare", "constants", "list"))
    parser.add_argument("variants", nargs="*")
    parser.add_argument("--variant", default="base")
    parser.add_argument("--base", default="base", help="the variant that constants are compared with")
    parser.add_argument("--exe", default=os.environ.get("NEUPIG", str(ROOT / "build" / "neupig")))
    parser.add_argument("--bodies", help="neupig-bodies; default: beside the command, or in build/")
    parser.add_argument("--args", default="")
    parser.add_argument("--bed", choices=("whole", "small"))
    parser.add_argument("--only", default="")
    parser.add_argument("--seeds", help="of noise and samples: 1,2,3, of the small bed 1")
    parser.add_argument("--frames", type=int, default=12)
    parser.add_argument("--points", type=int, default=2000)
    parser.add_argument("--faces", type=int, default=8000)
    parser.add_argument("--folder", type=pathlib.Path, default=ROOT / "build" / "bed")
    parser.add_argument("--data", type=pathlib.Path, default=os.environ.get("NEUPIG_BED_DATA"))
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--room", default="mesh")
    parser.add_argument("--files", default="", help="of a room, those with that text in their name")
    parser.add_argument("--scales", default="0.7,1.4")
    parser.add_argument("--all", action="store_true", help="also what has not moved")
    options = parser.parse_args()
    is_small = (options.bed or ("small" if options.verb == "constants" else "whole")) == "small"
    options.seeds = [int(seed) for seed in (options.seeds or ("1" if is_small else "1,2,3")).split(",")]
    options.scales = [float(scale) for scale in options.scales.split(",")]
    options.folder, options.exe = options.folder.absolute(), os.path.abspath(options.exe)
    beside = f"{options.exe}-bodies"
    options.bodies = options.bodies or (beside if os.path.exists(beside) else str(ROOT / "build" / "neupig-bodies"))
    options.is_quiet = options.verb == "constants"
    options.captures = [name for name in (SMALL if is_small else CAPTURES) if options.only in name]
    if options.verb in ("run", "constants"):
        options.folder.mkdir(parents=True, exist_ok=True)
        options.captures = find_there(options, options.captures)
    return options


def main():
    options = parse()
    if options.verb == "list":
        print("\n".join(options.captures))
    elif options.verb == "run":
        run_variant(options, options.variant)
    elif options.verb == "constants":
        judge_constants(options)
    elif len(options.variants) != 2:
        sys.exit("compare takes two variants")
    else:
        before, after = (read_rows(options, variant) for variant in options.variants)
        wanted = set(options.captures)
        show_comparison(*({key: row for key, row in rows.items() if key[0] in wanted} for rows in (before, after)), options.all)


if __name__ == "__main__":
    main()

#!/usr/bin/env python3
"""One row for each capture in tests/accuracy.csv: how near the meshes of this commit are, and what they cost.

    tests/accuracy.py [CAPTURES] [--quick] [--dry-run]

CAPTURES, or the environment's NEUPIG_CAPTURES, is a folder with the captures of the guide's figures (samples/guide/figures.md
says where they come from), each as NAME/points and NAME/gt:

    samba17   dancer, frames 0 to 16              horse17   galloping horse, frames 0 to 16
    samba48c3 dancer, frames 0 to 47, seen by 3 cameras, no normals
    noisy40   dancer, frames 0 to 39, noise 0.5, outliers 1 %, 2 holes, no normals
    samba175  dancer, all frames

Those that are not there are left out, and that is said; without any the script ends with 0.  --quick takes the two of 17
frames, half a minute; all take 4 minutes on two cores.  --dry-run shows the rows and leaves the file alone.  NEUPIG names the
command (build/neupig).

Processor seconds are those of the whole run, children included.  The exit code is 1 where a run fails, and where a figure
is more than 1 % worse than the best that the file has of that capture.
"""

import csv
import datetime
import os
import pathlib
import re
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parent.parent
FILE = ROOT / "tests" / "accuracy.csv"
QUICK = ("samba17", "horse17")
CAPTURES = QUICK + ("samba48c3", "noisy40", "samba175")
COLUMNS = ("date", "commit", "capture", "CD", "NC", "Corr", "processor_s", "lines", "options", "constants")
BETTER = {"CD": min, "NC": max, "Corr": min}
TOLERATED = 0.01


def output_of(*command):
    return subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True).stdout.strip()


def find_commit():
    """HEAD; with a + where the tree has changes that are in no commit."""
    changed = output_of("git", "status", "--porcelain", "--untracked-files=no", "--", ".", f":!{FILE.relative_to(ROOT)}")
    return output_of("git", "rev-parse", "--short", "HEAD") + ("+" if changed else "")


def run_capture(neupig, folder, out):
    """The processor seconds of a run; exits where it fails (7 is a finished one, too)."""
    process = subprocess.Popen([neupig, "run", folder / "points", "-o", out, "--quiet"], stdout=subprocess.DEVNULL)
    _, status, used = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode not in (0, 7):
        sys.exit(f"{folder.name}: neupig run ended with {process.returncode}")
    return used.ru_utime + used.ru_stime


def measure(neupig, folder):
    with tempfile.TemporaryDirectory() as scratch:
        out = pathlib.Path(scratch) / "out"
        seconds = run_capture(neupig, folder, out)
        told = output_of(neupig, "eval", out, folder / "gt")
    figures = {name: re.search(rf"\b{name} ([0-9.]+)", told)[1] for name in BETTER}
    return {**figures, "processor_s": f"{seconds:.1f}"}


def find_worse(row, earlier):
    """What of a row is worse than the best of the rows before it."""
    for name, best_of in BETTER.items():
        values = [float(other[name]) for other in earlier if other["capture"] == row["capture"]]
        if not values:
            continue
        best = best_of(values)
        change = (float(row[name]) - best) / best * (-1 if best_of is max else 1)
        if change > TOLERATED:
            yield f"{row['capture']}: {name} is {row[name]}, {100 * change:.1f} % worse than {best:g}"


def main():
    words = [word for word in sys.argv[1:] if not word.startswith("--")]
    source = words[0] if words else os.environ.get("NEUPIG_CAPTURES", "")
    wanted = QUICK if "--quick" in sys.argv else CAPTURES
    there = [name for name in wanted if source and (pathlib.Path(source) / name / "points").is_dir()]
    for name in wanted:
        if name not in there:
            print(f"{name}: not at hand (CAPTURES or NEUPIG_CAPTURES is \"{source}\"), left out")
    if not there:
        return 0
    neupig = os.path.abspath(os.environ.get("NEUPIG", ROOT / "build" / "neupig"))
    size = output_of(sys.executable, ROOT / "tests" / "structure" / "size.py", ROOT, neupig, "--row").split(",")
    shared = {"date": datetime.date.today().isoformat(), "commit": find_commit(), **dict(zip(COLUMNS[-3:], size))}
    with FILE.open(newline="") as file:
        earlier = list(csv.DictReader(file))
    faults = []
    for name in there:
        row = {**shared, "capture": name, **measure(neupig, (pathlib.Path(source) / name).absolute())}
        print(",".join(row[column] for column in COLUMNS), flush=True)
        faults += find_worse(row, earlier)
        if "--dry-run" not in sys.argv:
            with FILE.open("a", newline="") as file:
                csv.DictWriter(file, COLUMNS, lineterminator="\n").writerow(row)
    for fault in faults:
        print(fault)
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())

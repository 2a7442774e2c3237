#!/usr/bin/env python3
"""Runs a grid of settings on several captures and prints accuracy against cost.

    tools/explore.py -o explored --synth --vary epochs=15,30 --vary samples=800,1500
    tools/explore.py -o explored --capture dancer=points/,truth/,0:17 --setting paper='--preset paper --epochs 250' \
        --vary epochs=15,30,60
    tools/plot_explore.py explored/results.jsonl -o accuracy.svg

Every run of `neupig run` is measured with `neupig eval` and becomes one line of DIR/results.jsonl; a run that has its
line is not made again, so the same command resumes where it was stopped.  Cost is the wall and processor seconds of the
whole command, files in to files out.  Needs Python 3 alone.
"""
import argparse
import itertools
import json
import os
import shlex
import shutil
import sys

import measure

FIGURES = measure.FIGURES[:4]


def fail(text):
    sys.exit(f"explore: {text}")


def parse_arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("-o", "--output", required=True, metavar="DIR", help="where results.jsonl and the runs go")
    parser.add_argument("--capture", action="append", default=[], metavar="NAME=POINTS[,TRUTH[,FRAMES]]",
                        help="a capture, with its truth; FRAMES as of neupig run --frames")
    parser.add_argument("--synth", action="store_true", help="add a made walking figure with noise and outliers")
    parser.add_argument("--synth-frames", type=int, default=17, metavar="N")
    parser.add_argument("--synth-points", type=int, default=5000, metavar="N")
    parser.add_argument("--vary", action="append", default=[], metavar="OPTION=A,B,...",
                        help="an option of neupig run and its values; several make a grid")
    parser.add_argument("--setting", action="append", default=[], metavar="NAME='OPTIONS'",
                        help="one more setting beside the grid")
    parser.add_argument("--options", default="", metavar="'OPTIONS'", help="options of every run of the grid")
    parser.add_argument("--neupig", default=os.environ.get("NEUPIG", "build/neupig"), metavar="FILE")
    parser.add_argument("--keep", action="store_true", help="keep the meshes of every run")
    parser.add_argument("--json", action="store_true", help="print the results as JSON instead of a table")
    return parser.parse_args()


def grid(arguments):
    """[(name, options)] of all settings."""
    axes, settings = [], []
    for vary in arguments.vary:
        option, equals, values = vary.partition("=")
        if not equals or not values:
            fail(f"--vary {vary}: wanted OPTION=A,B,...")
        axes.append([(option, value) for value in values.split(",")])
    if axes or not arguments.setting:
        for point in itertools.product(*axes):
            name = " ".join(f"{option}={value}" for option, value in point) or "default"
            options = [text for option, value in point for text in (f"--{option}={value}",)]
            settings.append((name, shlex.split(arguments.options) + options))
    for setting in arguments.setting:
        name, equals, options = setting.partition("=")
        if not equals:
            fail(f"--setting {setting}: wanted NAME='OPTIONS'")
        settings.append((name, shlex.split(options)))
    return settings


def captures(arguments):
    """[(name, points, truth, frames)]."""
    found = [measure.parse_capture(capture, fail) for capture in arguments.capture]
    if arguments.synth or not found:
        name = f"walker-{arguments.synth_frames}x{arguments.synth_points}"
        size = ("--frames", str(arguments.synth_frames), "--points", str(arguments.synth_points))
        made = measure.synth(arguments.neupig, os.path.join(arguments.output, name), size + measure.SYNTH_LIKE_A_SCAN)
        found.append((name, *made, ""))
    return found


def measured(arguments, capture, setting, folder):
    """One line of results."""
    name, points, truth, frames = capture
    result = {"capture": name, "setting": setting[0], "options": setting[1], "frames": frames}
    result.update(measure.measure(arguments.neupig, points, truth, frames, setting[1], folder))
    return result


def key_of(result):
    return result["capture"], result["frames"], tuple(result["options"])


def print_table(results):
    print(f"{'capture':<20} {'setting':<40} {'wall s':>8} {'cpu s':>8} {'CD':>9} {'NC':>7} {'F':>7} {'Corr':>9}")
    for r in sorted(results, key=lambda r: (r["capture"], r["cpu_s"])):
        figures = [r.get(key) for key in FIGURES]
        shown = [f"{v:>{w}.{p}f}" if v is not None else f"{'-':>{w}}"
                 for v, w, p in zip(figures, (9, 7, 7, 9), (4, 4, 4, 5))]
        note = "" if r["exit_code"] == 0 else f"  exit code {r['exit_code']}"
        print(f"{r['capture']:<20} {r['setting']:<40} {r['wall_s']:>8.2f} {r['cpu_s']:>8.2f} {' '.join(shown)}{note}")


def main():
    arguments = parse_arguments()
    os.makedirs(os.path.join(arguments.output, "runs"), exist_ok=True)
    path = os.path.join(arguments.output, "results.jsonl")
    results = measure.read_lines(path, fail)
    done = {key_of(result) for result in results}
    with open(path, "w", encoding="utf-8") as out:  # without a line that was cut off
        out.writelines(json.dumps(result) + "\n" for result in results)
    jobs = list(itertools.product(captures(arguments), grid(arguments)))
    for i, (capture, setting) in enumerate(jobs, 1):
        if (capture[0], capture[3], tuple(setting[1])) in done:
            continue
        print(f"explore: {i}/{len(jobs)} {capture[0]}: {setting[0]}", file=sys.stderr, flush=True)
        folder = os.path.join(arguments.output, "runs", f"{capture[0]}-{i}")
        result = measured(arguments, capture, setting, folder)
        results.append(result)
        with open(path, "a", encoding="utf-8") as out:
            out.write(json.dumps(result) + "\n")
        if not arguments.keep:
            shutil.rmtree(folder, ignore_errors=True)
    if arguments.json:
        json.dump(results, sys.stdout, indent=1)
        print()
    else:
        print_table(results)
    return 0 if all(result["exit_code"] in (0, 7) for result in results) else 1


if __name__ == "__main__":
    sys.exit(main())

"""What explore.py and figures.py share: one run of the command, timed and compared with its truth.

Cost is that of the whole command, files in to files out: wall and processor seconds, and the most resident memory of its
largest process.  Needs Python 3 alone.
"""
import ctypes
import datetime
import json
import os
import shutil
import signal
import subprocess
import sys
import time

FIGURES = ("CD", "NC", "F", "Corr", "jitter")
SYNTH_LIKE_A_SCAN = ("--noise", "0.2", "--outliers", "1")
LIBC = ctypes.CDLL(None)
PR_SET_PDEATHSIG = 1  # linux/prctl.h


def end_with_parent():
    """In a child process: it does not outlive a script that is killed, nor keep its folder locked."""
    LIBC.prctl(PR_SET_PDEATHSIG, signal.SIGKILL)


def timed(command, log):
    """Exit code, wall seconds, processor seconds with those of child processes, MiB resident at most."""
    start = time.monotonic()
    with open(log, "ab") as out:
        process = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=out, stderr=out,
                                   preexec_fn=end_with_parent)
        _, status, usage = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
    return {"exit_code": process.returncode, "wall_s": round(time.monotonic() - start, 3),
            "cpu_s": round(usage.ru_utime + usage.ru_stime, 3), "memory_mib": round(usage.ru_maxrss / 1024, 1)}


def compare(neupig, folder, truth, frames):
    """The figures of neupig eval; those of the worst frame for CD and Corr besides."""
    chosen = ["--frames", frames] if frames else []
    done = subprocess.run([neupig, "eval", folder, truth, "--json"] + chosen, stdin=subprocess.DEVNULL,
                          stdout=subprocess.PIPE, check=True)
    told = json.loads(done.stdout)
    figures = {key: told.get(key) for key in FIGURES}
    for key in ("CD", "Corr"):
        values = [frame[key] for frame in told["per_frame"] if frame.get(key) is not None]
        figures[f"worst_{key}"] = max(values, default=None)
    return figures


def explains(folder):
    """How well the run itself says that the surface explains the points: for captures without a truth."""
    with open(os.path.join(folder, "report.json"), encoding="utf-8") as file:
        figures = json.load(file)["stages"]["evaluate"]["figures"]
    return {"point_dist_median": figures["point_dist_median"]["mean"], "coverage": figures["coverage"]["mean"]}


def method_of(options):
    """Options written as --name value or --no-name, as one object for --method: keys of the method may be among them."""
    method, name, given = {}, "", []
    for word in (part for option in options for part in option.split("=", option.startswith("--"))):
        if word.startswith("--"):
            name = word[2:]
            method[name.removeprefix("no-")] = not name.startswith("no-")
        else:
            method[name] = word
            if name == "method":  # a name, a file or an object itself
                given += ["--method", method.pop(name)]
    return given + (["--method", json.dumps(method)] if method else [])


def measure(neupig, points, truth, frames, options, folder):
    """One run into FOLDER and its figures; exit code 7 (below the quality bar) is a result too."""
    chosen = ["--frames", frames] if frames else []
    shutil.rmtree(folder, ignore_errors=True)
    result = timed([neupig, "run", points, "-o", folder, "--quiet"] + chosen + method_of(options), folder + ".log")
    if result["exit_code"] in (0, 7):
        result.update(explains(folder))
        if truth:
            result.update(compare(neupig, folder, truth, frames))
    return result


def synth(neupig, folder, options):
    """A made capture with its truth, made once; the folders of its points and of its truth."""
    if not os.path.isdir(os.path.join(folder, "truth")):
        shutil.rmtree(folder, ignore_errors=True)
        subprocess.run([neupig, "synth", "-o", folder + ".part"] + list(options), check=True, stdout=subprocess.DEVNULL)
        os.replace(folder + ".part", folder)
    return os.path.join(folder, "points"), os.path.join(folder, "truth")


def machine():
    """What the figures were measured on: kind and number of processors, widest vectors, what else was at work."""
    flags, model = "", "unknown"
    with open("/proc/cpuinfo", encoding="utf-8") as lines:
        for line in lines:
            key, _, value = line.partition(":")
            if key.strip() == "model name":
                model = value.strip()
            elif key.strip() == "flags":
                flags = value.split()
    vectors = next((name for flag, name in (("avx512f", "AVX-512"), ("avx2", "AVX2"), ("avx", "AVX")) if flag in flags),
                   "none known")
    return {"processor": model, "cores": len(os.sched_getaffinity(0)), "vectors": vectors,
            "load": round(os.getloadavg()[0], 1)}


def source(neupig):
    """Version of the command, and the last commit that changed its code."""
    version = subprocess.run([neupig, "version"], check=True, stdout=subprocess.PIPE, text=True).stdout.split()[1]
    tree = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
    code = [f"{folder}/*.[ch]*" for folder in ("pipeline", "stages", "kernels", "tools")]
    found = ""
    if shutil.which("git"):
        found = subprocess.run(["git", "-C", tree, "log", "-1", "--format=%h", "--"] + code, stdout=subprocess.PIPE,
                               stderr=subprocess.DEVNULL, text=True, check=False).stdout.strip()
    return {"version": version, "commit": found or "unknown", "date": datetime.date.today().isoformat()}


def read_lines(path, fail):
    """The JSON objects of a file of lines; the last one may have been cut off by a kill."""
    if not os.path.exists(path):
        return []
    results = []
    with open(path, encoding="utf-8") as lines:
        for number, line in enumerate(lines, 1):
            try:
                results.append(json.loads(line))
            except json.JSONDecodeError as error:
                if line.endswith("\n"):
                    fail(f"{path}, line {number}: {error}")
    return results


def parse_capture(text, fail):
    """(name, points, truth, frames) of NAME=POINTS[,TRUTH[,FRAMES]]."""
    name, equals, rest = text.partition("=")
    parts = rest.split(",") + ["", ""]
    if not equals or not parts[0] or len(parts) > 5:
        fail(f"--capture {text}: wanted NAME=POINTS[,TRUTH[,FRAMES]]")
    return name, parts[0], parts[1], parts[2]


def note(text):
    print(text, file=sys.stderr, flush=True)

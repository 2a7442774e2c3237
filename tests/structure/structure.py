#!/usr/bin/env python3
"""Where includes may point: no circle between rooms or inside one, no arrow the wrong way.

    structure.py ROOT         reads every #include under ROOT; exit code 1 names each that breaks a rule
    structure.py --prove ROOT copies the tree, breaks every rule once, and expects each to be named

A room is a folder of stages/: ingest, mesh, job ...  An include names the room of what it includes:
"mesh/surface.h" is stages/mesh/surface.h, "pipeline/mesh.h" is pipeline's.
"""

import pathlib
import re
import shutil
import subprocess
import sys
import tempfile

# Who may include what; a folder or room may always include itself.
#   rooms  any room of stages/ (as long as there is no circle)
#   doors  of rooms and kernels only the header that bears their name: "ingest/ingest.h", "kernels/kernels.h"
ARROWS = {
    "pipeline": "neupig.h",
    "kernels":  "pipeline/status.h pipeline/memory.h pipeline/file.h pipeline/json_file.h "
                "pipeline/random.h pipeline/child.h",
    "geometry": "pipeline kernels",
    "job":      "pipeline kernels ingest",
    "track":    "pipeline geometry",
    "rooms":    "pipeline kernels rooms",  # the other rooms
    "chain":    "pipeline",                # stages/chain.c
    "tools":    "pipeline neupig.h doors",
    "tools/verb_bench.c": "pipeline neupig.h kernels rooms tools",  # times what lies inside the rooms
    "samples":  "neupig.h",
    "tests":    "pipeline kernels rooms tools neupig.h kernels_embedded.c",
}
# Rooms whose file of the same name holds no stage: geometry, track and reference serve other rooms, job serves the run.
NO_STAGE = {"geometry", "track", "job"}
# Rooms that no other one includes.
CLOSED = {"align"}
# Circles of includes between the files of a room (a .c with its .h and its _internal.h) that are still to be opened: whoever opens one
# takes it from this list, and none is added.
OPEN_CIRCLES = []
# Headers that need no room in front: the public one, and what the build makes.
NO_ROOM = {"neupig.h", "kernels_embedded.c"}
CPP_LIBRARIES = ("pcl/", "openvdb/", "Eigen/", "tbb/", "Imath/", "boost/")
TOP_FOLDERS = ("pipeline", "stages", "kernels", "tools", "samples", "tests")
SOURCES = {".c", ".h", ".cpp", ".hpp"}
INCLUDE = re.compile(r'^\s*#\s*include\s*([<"])([^">]+)[">]')


class Include:
    """One #include: where it stands, in which room, and what it names."""

    def __init__(self, root, path, line, quoted, name):
        self.place = f"{path.relative_to(root)}:{line}"
        self.file = path.relative_to(root).as_posix()
        self.is_cpp = path.suffix in (".cpp", ".hpp")
        self.room = room_of(self.file)
        self.quoted, self.name = quoted, name
        self.target = name.split("/")[0] if "/" in name else None

    def says(self, what):
        return f"{self.place}: {self.room} -> {self.name}: {what}"


def room_of(file):
    """The room of a file of the tree: its folder under stages/, else its top folder."""
    parts = file.split("/")
    if parts[0] != "stages":
        return parts[0]
    return parts[1] if len(parts) > 2 else "chain"


def read_includes(root):
    for top in TOP_FOLDERS:
        for path in sorted((root / top).rglob("*")):
            if path.suffix not in SOURCES:
                continue
            for number, text in enumerate(path.read_text(errors="replace").splitlines(), 1):
                match = INCLUDE.match(text)
                if match:
                    yield Include(root, path, number, match[1] == '"', match[2])


def read_rooms(root):
    return {path.name for path in (root / "stages").iterdir() if path.is_dir()}


def may_include(include, rooms):
    """Whether the table has the arrow of a quoted include."""
    line = ARROWS.get(include.file, ARROWS.get(include.room, ARROWS["rooms"])).split()
    if include.target == include.room or include.target in line or include.name in line:
        return True
    if "rooms" in line and include.target in rooms:
        return include.target not in CLOSED or include.room == "tests"
    is_door = include.name == f"{include.target}/{include.target}.h" and include.target in rooms | {"kernels"}
    return "doors" in line and is_door


def check_includes(root, includes, rooms):
    folders = {name: root / name for name in TOP_FOLDERS} | {room: root / "stages" / room for room in rooms}
    for include in includes:
        cpp = not include.name.endswith((".h", ".c")) or include.name.startswith(CPP_LIBRARIES)
        if cpp and not include.is_cpp:
            yield include.says("a C++ header outside .cpp and .hpp")
        if not include.quoted:
            continue
        if not include.target and include.name not in NO_ROOM:
            yield include.says("names no room")
        elif include.target and include.target not in folders:
            yield include.says("no such room")
        elif include.target and not (folders[include.target] / include.name.split("/", 1)[1]).is_file():
            yield include.says("no such file")
        elif not may_include(include, rooms):
            line = ARROWS.get(include.room, ARROWS["rooms"])
            yield include.says(f"wrong arrow; {include.room} may include {line}")


def find_circle(arrows):
    """A list of rooms, or files, each of which includes the next, the last the first; None when there is none."""
    done, way = set(), []

    def walk(room):
        if room in way:
            return way[way.index(room):]
        if room in done:
            return None
        way.append(room)
        for other in sorted(arrows.get(room, {})):
            circle = walk(other)
            if circle:
                return circle
        done.add(way.pop())
        return None

    for room in sorted(arrows):
        circle = walk(room)
        if circle:
            return circle
    return None


def check_circles(includes, rooms):
    arrows = {}  # arrows[a][b]: the first include by which room a needs room b
    for include in includes:
        if include.quoted and include.room in rooms and include.target in rooms and include.target != include.room:
            arrows.setdefault(include.room, {}).setdefault(include.target, include)
    while circle := find_circle(arrows):
        yield "circle between rooms: " + " -> ".join(circle + circle[:1])
        for room, other in zip(circle, circle[1:] + circle[:1]):
            yield f"    {arrows[room][other].place}: {room} -> {arrows[room][other].name}"
        del arrows[circle[-1]][circle[0]]  # the next one, if any


def stem_of(file):
    """What stands for a .c with its .h and its _internal.h."""
    return file.rsplit(".", 1)[0].removesuffix("_internal")


def check_file_circles(root, includes):
    arrows = {}
    for include in includes:
        stem = stem_of(include.file)
        target = next((top + include.name for top in ("", "stages/") if (root / (top + include.name)).is_file()), "")
        other = stem_of(target)
        if include.quoted and include.room == room_of(target) != "tests" and other != stem:
            arrows.setdefault(stem, {}).setdefault(other, include)
    known = [set(line.split()) for line in OPEN_CIRCLES]
    seen = []
    while circle := find_circle(arrows):
        seen += circle
        if not any(set(circle) <= files for files in known):
            yield "circle inside a room: " + " -> ".join(circle + circle[:1])
        del arrows[circle[-1]][circle[0]]  # the next one, if any
    for line, files in zip(OPEN_CIRCLES, known):
        if not files & set(seen):
            yield f"OPEN_CIRCLES lists files of which none is in a circle any more: {line}"


def check_files(root, rooms):
    for path in sorted((root / "stages").iterdir()):
        if path.is_file() and path.name not in ("chain.c", "README.md"):
            yield f"stages/{path.name}: a flat file; only chain.c and the README stand outside the rooms"
    for room in sorted(rooms - NO_STAGE):
        path = root / "stages" / room / f"{room}.c"
        descriptor = f"const npg_stage npg_stage_{room} = "
        if not path.is_file() or descriptor not in path.read_text():
            yield f"stages/{room}: no {room}.c with the stage's descriptor (npg_stage_{room})"


def check(root):
    includes, rooms = list(read_includes(root)), read_rooms(root)
    return [*check_includes(root, includes, rooms), *check_circles(includes, rooms),
            *check_file_circles(root, includes), *check_files(root, rooms)]


# ---- the proof ----

# What is planted into a copy, file: line, and the words of the one line that must name it.
PLANTED = [
    ("stages/geometry/planted.c", '#include "ingest/ingest.h"', "geometry -> ingest/ingest.h: wrong arrow"),
    ("stages/track/planted.c", '#include "mesh/surface.h"', "track -> mesh/surface.h: wrong arrow"),
    ("stages/evaluate/planted.h", '#include "align/align_internal.h"', "evaluate -> align/align_internal.h: wrong arrow"),
    ("stages/job/planted.c", '#include "outlier/normals.h"', "job -> outlier/normals.h: wrong arrow"),
    ("stages/mesh/planted.c", '#include "tools/cli.h"', "mesh -> tools/cli.h: wrong arrow"),
    ("pipeline/planted.c", '#include "kernels/kernels.h"', "pipeline -> kernels/kernels.h: wrong arrow"),
    ("kernels/planted.c", '#include "pipeline/stage.h"', "kernels -> pipeline/stage.h: wrong arrow"),
    ("tools/planted.c", '#include "mesh/mesh_internal.h"', "tools -> mesh/mesh_internal.h: wrong arrow"),
    ("samples/planted.c", '#include "pipeline/mesh.h"', "samples -> pipeline/mesh.h: wrong arrow"),
    ("stages/outlier/planted.c", '#include "outlier.h"', "outlier -> outlier.h: names no room"),
    ("stages/outlier/planted.h", '#include "outlier/nowhere.h"', "outlier -> outlier/nowhere.h: no such file"),
    ("stages/evaluate/planted.c", "#include <vector>", "evaluate -> vector: a C++ header"),
    ("stages/export/planted.c", "#include <pcl/point_types.h>", "export -> pcl/point_types.h: a C++ header"),
    ("stages/planted.c", "", "stages/planted.c: a flat file"),
    ("stages/lodge/planted.c", "", "stages/lodge: no lodge.c with the stage's descriptor"),
    # a circle of two, and one of three
    ("stages/one/two.h", '#include "two/one.h"', "circle between rooms: one -> two"),
    ("stages/two/one.h", '#include "one/two.h"', "stages/two/one.h:1: two -> one/two.h"),
    ("stages/red/red.h", '#include "green/green.h"', "circle between rooms: blue -> red -> green -> blue"),
    ("stages/green/green.h", '#include "blue/blue.h"', "stages/green/green.h:1: green -> blue/blue.h"),
    ("stages/blue/blue.h", '#include "red/red.h"', "stages/blue/blue.h:1: blue -> red/red.h"),
    # inside a room
    ("stages/mesh/egg.h", '#include "mesh/hen.h"', "circle inside a room: stages/mesh/egg -> stages/mesh/hen -> stages/mesh/egg"),
    ("stages/mesh/hen.h", '#include "mesh/egg.h"', "stages/mesh/egg"),
]


def prove(root):
    with tempfile.TemporaryDirectory() as folder:
        copy = pathlib.Path(folder)
        for top in TOP_FOLDERS:
            shutil.copytree(root / top, copy / top, ignore=shutil.ignore_patterns("*.cl", "__pycache__", "*.egg-info"))
        for file, line, _ in PLANTED:
            (copy / file).parent.mkdir(exist_ok=True)
            (copy / file).write_text(line + "\n")
        run = subprocess.run([sys.executable, __file__, str(copy)], capture_output=True, text=True, check=False)
        missing = [words for _, _, words in PLANTED if words not in run.stdout]
        for words in missing:
            print(f"planted, but not named: {words}")
        if missing or run.returncode != 1:
            print(f"exit code {run.returncode}, output:\n{run.stdout}{run.stderr}")
            return 1
        print(f"{len(PLANTED)} planted faults are named")
        return 0


def main():
    if sys.argv[1] == "--prove":
        return prove(pathlib.Path(sys.argv[2]))
    faults = check(pathlib.Path(sys.argv[1]))
    for fault in faults:
        print(fault)
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())

#!/usr/bin/env python3
"""Writes a rig.json, which neupig reads, into a folder of depth images that another program has written.

    rig_json.py FOLDER [--depth-scale UNITS] [--tolerance SECONDS]
    rig_json.py RIG.json [--tolerance SECONDS]

Known are TUM RGB-D (depth.txt; rgb.txt, groundtruth.txt), Redwood and Open3D (depth/ and intrinsic.json; color/,
trajectory.log), and OpenCV's files per frame (0001_camera.xml or .yml beside 0001_depth.png; 0001.jpg, 0001_mask.jpg).
Images stay where they are.  Of a rig.json whose sensors name lists of "time path" lines (depth, colour: *.txt) or a file
of poses ("number-or-time tx ty tz qx qy qz qw" lines, or *.log: three integers and a 4 x 4 matrix for each image in
order), these are written into it: images of different sensors, and poses, are matched by their times.
"""

import argparse
import json
import math
import pathlib
import re
import struct
import sys

# The default calibration that TUM's own tools use; its folders hold none.  Steps of depth: its format description.
TUM_CAMERA = {"width": 640, "height": 480, "fx": 525, "fy": 525, "cx": 319.5, "cy": 239.5}
TUM_SCALE = 1 / 5000


def natural(path):
    return [int(part) if part.isdigit() else part for part in re.split(r"(\d+)", path.name)]


def images(folder, *endings):
    """Names of a folder's images in natural order, from the folder above."""
    files = sorted((f for f in folder.glob("*") if f.suffix.lower() in endings), key=natural)
    return [f"{folder.name}/{f.name}" for f in files]


def intrinsic(folder):
    """The camera that Open3D's file describes: its matrix has columns first; None without a file."""
    for name in ("intrinsic.json", "camera_intrinsic.json"):
        if (folder / name).is_file():
            text = json.loads((folder / name).read_text())
            m = text["intrinsic_matrix"]
            return {"width": text["width"], "height": text["height"], "fx": m[0], "fy": m[4], "cx": m[6], "cy": m[7]}
    return None


def lines(path):
    """Words of the lines that are neither empty nor comments."""
    try:
        return [words for line in path.read_text().split("\n") if (words := line.split()) and words[0][0] != "#"]
    except OSError as error:
        sys.exit(f"can't read {path}: {error.strerror}")


def stamped(folder, name):
    """Times and images of a list, whose paths are from its own folder."""
    inner = pathlib.PurePath(name).parent
    return [(float(words[0]), str(inner / " ".join(words[1:]))) for words in lines(folder / name)]


def pose_of(words, path):
    """Rows of [R | t] with 0 0 0 1, from tx ty tz qx qy qz qw."""
    t, (x, y, z, w) = [float(word) for word in words[:3]], [float(word) for word in words[3:7]]
    n = x * x + y * y + z * z + w * w
    if not abs(n - 1) < 0.02:
        sys.exit(f"{path}: the pose is no rotation: its quaternion has length {math.sqrt(n):g}")
    s = 2 / n
    return [1 - s * (y * y + z * z), s * (x * y - z * w), s * (x * z + y * w), t[0],
            s * (x * y + z * w), 1 - s * (x * x + z * z), s * (y * z - x * w), t[1],
            s * (x * z - y * w), s * (y * z + x * w), 1 - s * (x * x + y * y), t[2], 0, 0, 0, 1]


def poses_of(path):
    """Numbers or times, and poses; of a log their place in it."""
    rows = lines(path)
    if path.suffix == ".log":
        return [(at / 5, [float(word) for row in rows[at + 1:at + 5] for word in row]) for at in range(0, len(rows), 5)]
    return [(float(words[0]), pose_of(words[1:], path)) for words in rows]


def nearest(rows, time, tolerance):
    """The row whose first entry is nearest; None beyond the tolerance."""
    best = min(rows, key=lambda row: abs(row[0] - time), default=None)
    return best if best and abs(best[0] - time) <= tolerance else None


def match(folder, sensor, tolerance):
    """Time, depth, colour and pose of the images of a sensor with lists; those without a pose are left out."""
    colours = stamped(folder, sensor["colour"]) if "colour" in sensor else []
    poses = poses_of(folder / sensor["poses"]) if "poses" in sensor else None
    depth = stamped(folder, sensor["depth"])
    rows = [(time, name, nearest(colours, time, tolerance), nearest(poses or [], time, tolerance)) for time, name in depth]
    kept = [row for row in rows if row[3] or poses is None]
    if not kept:
        sys.exit(f"{folder}: none of the {len(depth)} depth images has a pose within {tolerance:g} s: images out of step")
    if len(kept) < len(depth):
        print(f"{len(depth) - len(kept)} of {len(depth)} depth images have no pose within {tolerance:g} s and are left out")
    return kept


def numbers_of(folder, pattern):
    """Numbers of the files of a pattern, growing."""
    number = re.compile(re.sub(r"%\d*d|(?:\\#)+", lambda _: r"(\d+)", re.escape(pattern), count=1))
    names = (str(file.relative_to(folder)) for file in folder.glob(re.sub(r"%\d*d|#+", "*", pattern)))
    return sorted(int(found[1]) for name in names if (found := number.fullmatch(name)))


def resolve(folder, sensors, tolerance):
    """Lists with times and files of poses become the lists that rig.json holds; times are those of the first sensor."""
    times = None
    for sensor in sensors:
        if not (isinstance(sensor["depth"], str) and sensor["depth"].endswith(".txt")):
            if isinstance(sensor.get("poses"), str):
                poses, path = poses_of(folder / sensor["poses"]), folder / sensor["poses"]
                numbers = numbers_of(folder, sensor["depth"])
                if path.suffix == ".log":
                    poses = list(zip(numbers, (pose for _, pose in poses)))
                missing = [number for number in numbers if not nearest(poses, number, 0)]
                if missing:
                    sys.exit(f"{path}: there is no pose for frame {missing[0]}")
                sensor["poses"] = [nearest(poses, number, 0)[1] for number in numbers]
            continue
        rows = match(folder, sensor, tolerance)
        times = times or [row[0] for row in rows]
        rows = [nearest(rows, time, tolerance) for time in times]
        sensor["depth"] = [row and row[1] for row in rows]
        if "colour" in sensor:
            sensor["colour"] = [row and row[2] and row[2][1] for row in rows]
        if "poses" in sensor:
            sensor["poses"] = [row[3][1] for row in rows if row]


def tum(folder):
    sensor = {"name": "tum", "depth": "depth.txt", "depth_scale": TUM_SCALE, "camera": intrinsic(folder) or TUM_CAMERA}
    for key, name in (("colour", "rgb.txt"), ("poses", "groundtruth.txt")):
        if (folder / name).is_file():
            sensor[key] = name
    return sensor


def redwood(folder):
    depth = images(folder / "depth", ".png")
    sensor = {"name": "redwood", "depth": depth, "camera": intrinsic(folder)}
    for name in ("color", "colour", "rgb", "image"):
        colour = images(folder / name, ".png", ".jpg", ".jpeg")
        if colour and len(colour) != len(depth):
            sys.exit(f"{folder}: {len(depth)} depth and {len(colour)} colour images: images out of step")
        if colour:
            sensor["colour"] = colour
            break
    log = folder / "trajectory.log"
    if log.is_file():
        poses = [pose for _, pose in poses_of(log)]
        if len(poses) != len(depth):
            sys.exit(f"{log}: {len(poses)} poses, but {len(depth)} depth images: images out of step")
        sensor["poses"] = poses
    return sensor


def matrix(text, path, names, count=None):
    """The numbers of a matrix of OpenCV's FileStorage, XML or YAML; [] where there is none and none must be."""
    for name in names:
        found = re.search(rf"<{name}[\s>](?:(?!</{name}>).)*?<data>(.*?)</data>", text, re.S) or re.search(
            rf"^\s*{name}:.*?data:\s*\[(.*?)\]", text, re.S | re.M)
        if not found:
            continue
        try:
            values = [float(word) for word in re.split(r"[\s,]+", found[1].strip())]
        except ValueError as error:
            sys.exit(f'{path}: "{name}": {error}')
        if count and len(values) != count:
            sys.exit(f'{path}: "{name}" has {len(values)} numbers, not {count}')
        return values
    if count:
        sys.exit(f'{path}: there is no matrix "{names[0]}"')
    return []


def pattern(folder, stems, endings):
    """The pattern of the files that every stem has with one of the endings; None without one."""
    for ending in endings:
        if all((folder / (stem + ending)).is_file() for stem in stems):
            return re.sub(r"\d+$", lambda digits: f"%0{len(digits[0])}d", stems[0]) + ending
    return None


def opencv(folder):
    stems = [f.name[:-len("_depth.png")] for f in sorted(folder.glob("*_depth.png"), key=natural)]
    camera, poses = None, []
    for stem in stems:
        path = next((p for end in ("xml", "yml", "yaml") if (p := folder / f"{stem}_camera.{end}").is_file()), None)
        if not path:
            sys.exit(f"{folder}/{stem}_depth.png: there is no *_camera.xml or .yml beside it: intrinsics missing")
        text = path.read_text()
        k = matrix(text, path, ["intrinsic", "camera_matrix", "cameraMatrix", "K"], 9)
        width, height = struct.unpack(">II", (folder / f"{stem}_depth.png").open("rb").read(24)[16:])
        own = {"width": width, "height": height, "fx": k[0], "fy": k[4], "cx": k[2], "cy": k[5]}
        lens = matrix(text, path, ["distortion", "distortion_coefficients", "distCoeffs", "D"])
        if lens:
            own["distortion"] = lens
        if camera and own != camera:
            sys.exit(f"{path}: other intrinsics than in the frames before it")
        camera = own
        r, t = matrix(text, path, ["R", "rotation"], 9), matrix(text, path, ["t", "T", "translation"], 3)
        if any(abs(sum(r[3 * i + k] * r[3 * j + k] for k in range(3)) - (i == j)) > 1e-3 for i in range(3) for j in range(i + 1)):
            sys.exit(f"{path}: the pose is no rotation")
        poses.append([*r[:3], t[0], *r[3:6], t[1], *r[6:], t[2], 0, 0, 0, 1])
    if not stems:
        sys.exit(f"{folder}: camera files, but no *_depth.png beside them")
    sensor = {"name": "opencv", "depth": pattern(folder, stems, ["_depth.png"]), "camera": camera, "poses": poses}
    for key, endings in (("colour", ["_color.png", "_color.jpg", ".png", ".jpg"]), ("mask", ["_mask.png", "_mask.jpg"])):
        if found := pattern(folder, stems, endings):
            sensor[key] = found
    return sensor


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("source", type=pathlib.Path, metavar="FOLDER or RIG.json")
    parser.add_argument("--depth-scale", type=float, metavar="UNITS", help="a step of the images; TUM 1/5000, else 0.001")
    parser.add_argument("--tolerance", type=float, default=0.02, metavar="SECONDS", help="between images of one frame; 0.02")
    given = parser.parse_args()
    folder = given.source
    if folder.suffix == ".json":
        # neupig takes comments in it
        root = json.loads(re.sub(r'("(?:\\.|[^"\\])*")|//[^\n]*', lambda found: found[1] or "", folder.read_text()))
        given.tolerance = root.pop("tolerance", given.tolerance)
        rig, folder = folder, folder.parent
    else:
        rig, root = folder / "rig.json", {"neupig_rig": 1, "sensors": []}
        if rig.exists():
            sys.exit(f"{rig}: there is one already")
        if (folder / "depth.txt").is_file():
            sensor = tum(folder)
        elif (folder / "depth").is_dir() and intrinsic(folder):
            sensor = redwood(folder)
        elif any(folder.glob("*_camera.[xy]*ml")):
            sensor = opencv(folder)
        else:
            sys.exit(f"{folder}: no layout that is known: no depth.txt, no depth/ with intrinsic.json, no *_camera.xml")
        if given.depth_scale:
            sensor["depth_scale"] = given.depth_scale
        root["sensors"].append(sensor)
    resolve(folder, root["sensors"], given.tolerance)
    rig.write_text(json.dumps(root, indent=1) + "\n")
    print(rig)


if __name__ == "__main__":
    main()

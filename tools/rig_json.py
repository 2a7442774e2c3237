#!/usr/bin/env python3
"""Writes a rig.json, which neupig reads, into a folder of depth images that another program has written.

    rig_json.py FOLDER [--depth-scale UNITS]

Known are TUM RGB-D (depth.txt; rgb.txt, groundtruth.txt), Redwood and Open3D (depth/ and intrinsic.json; color/,
trajectory.log), and OpenCV's files per frame (0001_camera.xml or .yml beside 0001_depth.png; 0001.jpg, 0001_mask.jpg).
Images stay where they are; lists and poses that rig.json names are written beside it where there are none of that form.
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


def tum(folder):
    sensor = {"name": "tum", "depth": "depth.txt", "depth_scale": TUM_SCALE, "camera": intrinsic(folder) or TUM_CAMERA}
    for key, name in (("colour", "rgb.txt"), ("poses", "groundtruth.txt")):
        if (folder / name).is_file():
            sensor[key] = name
    return sensor


def write_list(folder, name, paths):
    """Places in order as times: poses that come one per image are found by them."""
    (folder / name).write_text("".join(f"{at} {path}\n" for at, path in enumerate(paths)))
    return name


def redwood(folder):
    depth = images(folder / "depth", ".png")
    sensor = {"name": "redwood", "depth": write_list(folder, "rig_depth.txt", depth), "camera": intrinsic(folder)}
    for name in ("color", "colour", "rgb", "image"):
        colour = images(folder / name, ".png", ".jpg", ".jpeg")
        if colour and len(colour) != len(depth):
            sys.exit(f"{folder}: {len(depth)} depth and {len(colour)} colour images: images out of step")
        if colour:
            sensor["colour"] = write_list(folder, "rig_colour.txt", colour)
            break
    log = folder / "trajectory.log"
    if log.is_file():
        poses = len(log.read_text().split("\n")) // 5
        if poses != len(depth):
            sys.exit(f"{log}: {poses} poses, but {len(depth)} depth images: images out of step")
        sensor["poses"] = log.name
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


def quaternion(r):
    """x, y, z, w of a rotation, rows first: from the largest of the four, which no rounding makes small."""
    squares = [1 + r[0] - r[4] - r[8], 1 - r[0] + r[4] - r[8], 1 - r[0] - r[4] + r[8], 1 + r[0] + r[4] + r[8]]
    most = max(range(4), key=lambda k: squares[k])
    rows = [[squares[0], r[1] + r[3], r[2] + r[6], r[7] - r[5]], [r[1] + r[3], squares[1], r[5] + r[7], r[2] - r[6]],
            [r[2] + r[6], r[5] + r[7], squares[2], r[3] - r[1]], [r[7] - r[5], r[2] - r[6], r[3] - r[1], squares[3]]]
    length = math.sqrt(sum(value * value for value in rows[most]))
    return [value / length for value in rows[most]]


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
        poses.append(" ".join(repr(value) for value in [int(re.findall(r"\d+", stem)[-1]), *t, *quaternion(r)]))
    if not stems:
        sys.exit(f"{folder}: camera files, but no *_depth.png beside them")
    (folder / "rig_poses.txt").write_text("\n".join(poses) + "\n")
    sensor = {"name": "opencv", "depth": pattern(folder, stems, ["_depth.png"]), "camera": camera, "poses": "rig_poses.txt"}
    for key, endings in (("colour", ["_color.png", "_color.jpg", ".png", ".jpg"]), ("mask", ["_mask.png", "_mask.jpg"])):
        if found := pattern(folder, stems, endings):
            sensor[key] = found
    return sensor


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=pathlib.Path)
    parser.add_argument("--depth-scale", type=float, metavar="UNITS", help="a step of the images; TUM 1/5000, else 0.001")
    given = parser.parse_args()
    folder = given.folder
    if (folder / "rig.json").exists():
        sys.exit(f"{folder}/rig.json: there is one already")
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
    (folder / "rig.json").write_text(json.dumps({"neupig_rig": 1, "sensors": [sensor]}, indent=1) + "\n")
    print(f"{folder}/rig.json")


if __name__ == "__main__":
    main()

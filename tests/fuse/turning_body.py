#!/usr/bin/env python3
"""A body without an axis that turns once before one sensor, which sees a side of it in every frame.

    turning_body.py OUT           OUT/points/00NN.ply, OUT/sensor.txt
    turning_body.py --slide RUN   how far the vertices of RUN/meshes stray from the places that they would keep on
                                  a body that turns, mean, in diagonals; and the share of the body (points all
                                  round, at the keyframe) that RUN/reference.ply has
"""

import glob
import math
import os
import random
import struct
import sys

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "support"))
from plain_files import read_vertices

FRAMES, POINTS, SENSOR = 24, 1500, (0.0, 0.5, 8.0)


def radius(a, b, c):
    """In the direction (a, b, c): an egg, flat and with three lumps."""
    r = 1 / math.sqrt((a / 0.8) ** 2 + (b / 1.2) ** 2 + (c / 0.55) ** 2)
    for x, y, z in ((0.9, 0.3, 0.3), (-0.5, -0.6, 0.6), (-0.2, 0.5, -0.84)):
        r += 0.25 * math.exp(-8 * ((a - x) ** 2 + (b - y) ** 2 + (c - z) ** 2))
    return r


def place(chance):
    """A place on the body and the normal there."""
    b, turn = chance.uniform(-1, 1), chance.uniform(0, 2 * math.pi)
    s = math.sqrt(1 - b * b)
    way = (s * math.cos(turn), b, s * math.sin(turn))
    r = radius(*way)
    # the normal of |x| = r(x / |x|), by differences
    normal = []
    for axis in range(3):
        off = [r * w for w in way]
        off[axis] += 1e-4
        size = math.sqrt(sum(v * v for v in off))
        normal.append((size - radius(*(v / size for v in off))) / 1e-4)
    size = math.sqrt(sum(v * v for v in normal))
    return [r * w for w in way], [v / size for v in normal]


def turned(v, angle):
    c, s = math.cos(angle), math.sin(angle)
    return [c * v[0] + s * v[2], v[1], -s * v[0] + c * v[2]]


def angle_of(frame):
    return 2 * math.pi * frame / FRAMES


def write(out):
    os.makedirs(f"{out}/points")
    chance = random.Random(1)
    with open(f"{out}/sensor.txt", "w") as file:
        for _ in range(FRAMES):
            print(*SENSOR, file=file)
    for frame in range(FRAMES):
        rows = []
        while len(rows) < POINTS:
            p, n = (turned(v, angle_of(frame)) for v in place(chance))
            way = [s - x for s, x in zip(SENSOR, p)]
            if sum(a * b for a, b in zip(way, n)) > 0.15 * math.sqrt(sum(a * a for a in way)):
                rows.append(struct.pack("<3f", *p))
        with open(f"{out}/points/{frame:04}.ply", "wb") as file:
            head = f"ply\nformat binary_little_endian 1.0\nelement vertex {POINTS}\n"
            file.write((head + "property float x\nproperty float y\nproperty float z\nend_header\n").encode())
            file.write(b"".join(rows))


def places(path):
    return [(v["x"], v["y"], v["z"]) for v in read_vertices(path)]


def slide(run):
    back = []
    for frame, path in enumerate(sorted(glob.glob(f"{run}/meshes/*.ply"))):
        back.append([turned(v, -angle_of(frame)) for v in places(path)[::10]])
    diagonal, strays = 3.1, []
    for v in range(len(back[0])):
        middle = [sorted(f[v][a] for f in back)[len(back) // 2] for a in range(3)]
        strays += [math.dist(f[v], middle) / diagonal for f in back]
    key = int(sys.argv[3])
    have = [turned(v, -angle_of(key)) for v in places(f"{run}/reference.ply")]
    chance = random.Random(2)
    asked = [place(chance)[0] for _ in range(300)]
    found = sum(min(math.dist(p, v) for v in have) < 0.1 for p in asked)
    print(f"{sum(strays) / len(strays):.4f} {found / len(asked):.3f}")


if __name__ == "__main__":
    if sys.argv[1] == "--slide":
        slide(sys.argv[2])
    else:
        write(sys.argv[1])

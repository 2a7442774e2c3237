#!/usr/bin/env python3
"""A figure of rounded rods before one depth camera, its background removed, whose right arm hangs in the first half of the frames
and points to the side in the others, with nothing between.

    thrown_arm.py OUT          OUT/rig.json, OUT/depth/0000.png ...
"""

import json
import math
import os
import sys

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "support"))
from plain_files import write_depth

FRAMES, WIDE, HIGH, FOCAL, AWAY = 12, 160, 120, 120.0, 2.0
RODS = [  # x y x y radius, metres, y down
    (0, -0.35, 0, 0.25, 0.17), (0, -0.62, 0, -0.6, 0.11), (-0.09, 0.3, -0.12, 0.8, 0.08), (0.09, 0.3, 0.12, 0.8, 0.08),
    (-0.24, -0.4, -0.3, 0.1, 0.06)]
HANGS, POINTS = (0.24, -0.4, 0.3, 0.1, 0.06), (0.24, -0.4, 0.7, -0.3, 0.06)


def depth_of(rods, x, y):
    """Millimetres, 0: nothing; each rod as if seen from far away."""
    least = 0
    for ax, ay, bx, by, r in rods:
        dx, dy = bx - ax, by - ay
        t = min(1, max(0, ((x - ax) * dx + (y - ay) * dy) / (dx * dx + dy * dy)))
        off = (x - ax - t * dx) ** 2 + (y - ay - t * dy) ** 2
        if off >= r * r:
            continue
        depth = round(1000 * (AWAY - math.sqrt(r * r - off)))
        least = min(least, depth) if least else depth
    return least


def image_of(rods, sway):
    return [[depth_of(rods, (u - WIDE / 2) / FOCAL * AWAY - sway, (v - HIGH / 2) / FOCAL * AWAY) for u in range(WIDE)]
            for v in range(HIGH)]


def main(out):
    os.makedirs(out + "/depth")
    for n in range(FRAMES):
        arm = HANGS if n < FRAMES // 2 else POINTS
        write_depth("%s/depth/%04d.png" % (out, n), image_of(RODS + [arm], 0.004 * n))
    camera = {"width": WIDE, "height": HIGH, "fx": FOCAL, "fy": FOCAL, "cx": WIDE / 2, "cy": HIGH / 2}
    sensor = {"name": "front", "depth": "depth/%04d.png", "camera": camera}
    with open(out + "/rig.json", "w") as f:
        json.dump({"neupig_rig": 1, "unit": "m", "depth_scale": 0.001, "axes": "opencv", "sensors": [sensor]}, f)


main(sys.argv[1])

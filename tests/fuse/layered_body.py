#!/usr/bin/env python3
"""An ellipsoid that ten sensors on a ring see, each at a place of its own: their layers lie beside each other.

    layered_body.py OUT      OUT/points/000N.ply

No handle of its surface is the body's.
"""

import math
import os
import random
import sys

import ascii_ply

FRAMES, POINTS, SENSORS = 4, 30000, 10
AXES = (0.5, 1.0, 0.3)
LAYER, NOISE = 0.02, 0.003  # deviations: of each sensor's place, and of its depths
SLANT_LEAST = 0.3  # cosine between a sensor's direction and what it sees


def along(chance):
    """A direction."""
    way = [chance.gauss(0, 1) for _ in range(3)]
    length = math.hypot(*way)
    return [w / length for w in way]


def seen(chance, sensors, offsets):
    """A point and its normal, as one of the sensors has it."""
    while True:
        way, k = along(chance), chance.randrange(SENSORS)
        if sum(a * b for a, b in zip(way, sensors[k])) < SLANT_LEAST:
            continue
        slope = [w / a for w, a in zip(way, AXES)]
        length, off = math.hypot(*slope), chance.gauss(0, NOISE)
        normal = [s / length for s in slope]
        return [a * w + o + off * n for a, w, o, n in zip(AXES, way, offsets[k], normal)], normal


def main(out):
    os.makedirs(f"{out}/points")
    chance = random.Random(1)
    turns = [2 * math.pi * k / SENSORS for k in range(SENSORS)]
    sensors = [(math.cos(turn), 0, math.sin(turn)) for turn in turns]
    offsets = [[chance.gauss(0, LAYER) for _ in range(3)] for _ in sensors]
    for frame in range(FRAMES):
        points = (seen(chance, sensors, offsets) for _ in range(POINTS))
        rows = ((x + 0.02 * frame, y, z, *normal) for (x, y, z), normal in points)
        ascii_ply.write(f"{out}/points/{frame:04}.ply", POINTS, rows)


if __name__ == "__main__":
    main(sys.argv[1])

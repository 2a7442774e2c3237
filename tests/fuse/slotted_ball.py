#!/usr/bin/env python3
"""A ball with a slot through it, along y, that two sensors look through: its inside has no points.

    slotted_ball.py OUT      OUT/points/000N.ply, and OUT/sensors.txt: lines "NUMBER X Y Z"

The ball goes along x, and the sensors with it.  Without sensors nothing says that the slot is open.
"""

import math
import os
import random
import sys

import ascii_ply

FRAMES, POINTS, RADIUS, SLOT, FLOOR = 6, 3000, 1.0, 0.3, 0.2


def point(chance):
    """A place on the ball outside of the slot."""
    while True:
        z, turn = chance.uniform(-1, 1), chance.uniform(0, 2 * math.pi)
        x, y = math.sqrt(1 - z * z) * math.cos(turn), math.sqrt(1 - z * z) * math.sin(turn)
        if abs(x) > SLOT or z < FLOOR:
            return x, y, z


def main(out):
    os.makedirs(f"{out}/points")
    chance = random.Random(1)
    with open(f"{out}/sensors.txt", "w") as sensors:
        print("# number x y z", file=sensors)
        for frame in range(FRAMES):
            shift = 0.05 * frame
            for y in (-6, 6):
                print(frame, shift, y, 0.5, file=sensors)
            normals = (point(chance) for _ in range(POINTS))
            rows = ((n[0] + shift, n[1], n[2], *n) for n in normals)
            ascii_ply.write(f"{out}/points/{frame:04}.ply", POINTS, rows)


if __name__ == "__main__":
    main(sys.argv[1])

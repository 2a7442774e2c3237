#!/usr/bin/env python3
"""A capture for the bed from meshes that move: BODY.npz (verts T x V x 3, faces F x 3) to OUT/points and OUT/truth.

    sampled.py BODY.npz OUT [--start N] [--step N] [--frames N] [--points N] [--seed N] [--noise PERCENT] [--outliers PERCENT]
               [--cameras N] [--holes N] [--no-normals]

Options have the names and meanings of `neupig synth`.  Takes numpy.
"""

import argparse
import pathlib

import numpy as np

HOLE = 0.06  # of the diagonal: radius
PIXELS = 160  # across a camera's picture: some 20 dense samples fall into one


def sample(verts, faces, count, random):
    """Points spread evenly over the surface, with the normals of their faces."""
    corners = verts[faces]
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(cross, axis=1)
    of_face = np.searchsorted(np.cumsum(length), random.random(count) * length.sum()).clip(0, len(faces) - 1)
    root, along = np.sqrt(random.random((count, 1))), random.random((count, 1))
    weights = np.hstack([1 - root, root * (1 - along), root * along])
    return np.einsum("pc,pca->pa", weights, corners[of_face]), cross[of_face] / np.maximum(length[of_face], 1e-20)[:, None]


def is_seen(points, normals, eye, middle, size):
    """Whether each point faces the eye and is the nearest along its ray, as far as a picture of PIXELS tells."""
    forward = middle - eye
    forward /= np.linalg.norm(forward)
    right = np.cross(forward, [0.0, 1.0, 0.0])
    right /= np.linalg.norm(right)
    offsets = points - eye
    depth = offsets @ forward
    across = np.stack([offsets @ right, offsets @ np.cross(right, forward)], 1) / depth[:, None]
    reach = 0.6 * size / np.linalg.norm(middle - eye)
    pixel = ((across / reach + 1) / 2 * PIXELS).astype(int).clip(1, PIXELS)
    nearest = np.full((PIXELS + 2, PIXELS + 2), np.inf)
    np.minimum.at(nearest, (pixel[:, 0], pixel[:, 1]), depth)
    around = [nearest[pixel[:, 0] + i, pixel[:, 1] + j] for i in (-1, 0, 1) for j in (-1, 0, 1)]
    is_facing = (normals * offsets).sum(1) < -0.15 * np.linalg.norm(offsets, axis=1)
    return is_facing & (depth < np.min(around, axis=0) + 0.015 * size)


def write_ply(path, points, normals=None, faces=None):
    names = "x y z".split() + ("nx ny nz".split() if normals is not None else [])
    columns = points if normals is None else np.hstack([points, normals])
    head = ["ply", "format binary_little_endian 1.0", f"element vertex {len(points)}", *(f"property float {name}" for name in names)]
    if faces is not None:
        head += [f"element face {len(faces)}", "property list uchar int vertex_indices"]
    with open(path, "wb") as file:
        file.write(("\n".join([*head, "end_header"]) + "\n").encode())
        file.write(columns.astype("<f4").tobytes())
        if faces is not None:
            rows = np.zeros(len(faces), [("count", "u1"), ("corners", "<i4", 3)])
            rows["count"], rows["corners"] = 3, faces
            file.write(rows.tobytes())


def make_frame(options, verts, faces, size, random):
    count = options.points
    if not options.cameras:
        points, normals = sample(verts, faces, count, random)
    else:
        dense, dense_normals = sample(verts, faces, 20 * count, random)
        middle, seen = (verts.min(0) + verts.max(0)) / 2, np.zeros(len(dense), bool)
        for camera in range(options.cameras):
            angle = 2 * np.pi * camera / options.cameras
            eye = middle + 1.5 * size * np.array([np.sin(angle), 0.1, np.cos(angle)])
            seen |= is_seen(dense, dense_normals, eye, middle, size)
        chosen = random.permutation(np.flatnonzero(seen))[:count]
        points, normals = dense[chosen], dense_normals[chosen]
    for _ in range(options.holes):
        is_left = np.linalg.norm(points - points[random.integers(len(points))], axis=1) > HOLE * size
        points, normals = points[is_left], normals[is_left]
    points = points + random.normal(0, options.noise / 100 * size, points.shape) if options.noise else points
    is_out = random.random(len(points)) < options.outliers / 100
    low, high = points.min(0), points.max(0)
    points[is_out] = low + (high - low) * random.random((is_out.sum(), 3))
    return points, normals


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("body", type=pathlib.Path)
    parser.add_argument("out", type=pathlib.Path)
    for name, value in (("start", 0), ("step", 1), ("frames", 12), ("points", 2000), ("seed", 0), ("cameras", 0), ("holes", 0)):
        parser.add_argument(f"--{name}", type=int, default=value)
    for name in ("noise", "outliers"):
        parser.add_argument(f"--{name}", type=float, default=0)
    parser.add_argument("--no-normals", action="store_true")
    options = parser.parse_args()
    body, random = np.load(options.body), np.random.default_rng(options.seed)
    verts, faces = body["verts"].astype(float), body["faces"]
    size = np.linalg.norm(np.ptp(verts[options.start], axis=0))
    for folder in ("points", "truth"):
        (options.out / folder).mkdir(parents=True)
    for i in range(options.frames):
        now = verts[(options.start + i * options.step) % len(verts)]
        points, normals = make_frame(options, now, faces, size, random)
        write_ply(options.out / "points" / f"frame_{i:04d}.ply", points, None if options.no_normals else normals)
        write_ply(options.out / "truth" / f"frame_{i:04d}.ply", now, faces=faces)


if __name__ == "__main__":
    main()

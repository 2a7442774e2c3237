"""Mean difference between the colours of a run's keyframe mesh and the truth: colour_error.py OUT TRUTH

Each vertex that was seen (alpha 255) is compared with the nearest of many points of the truth's surface; the mean over
vertices and channels is printed last, in levels of 255.
"""

import json
import sys

import numpy as np

TYPES = {"float": "<f4", "double": "<f8", "uchar": "u1"}


def read_ply(path):
    """Positions, colours (RGBA) and faces of a binary PLY that neupig wrote."""
    head, body = open(path, "rb").read().split(b"end_header\n", 1)
    counts, fields, element = {}, [], ""
    for words in (line.split() for line in head.decode().splitlines()):
        if words[0] == "element":
            element = words[1]
            counts[element] = int(words[2])
        elif words[0] == "property" and element == "vertex":
            fields.append((words[2], TYPES[words[1]]))
    vertex = np.dtype(fields)
    rows = np.frombuffer(body, vertex, counts["vertex"])
    face = np.dtype([("n", "u1"), ("corners", "<i4", 3)])
    faces = np.frombuffer(body, face, counts["face"], vertex.itemsize * counts["vertex"])["corners"]
    return (np.stack([rows[c] for c in "xyz"], 1).astype(np.float32),
            np.stack([rows[c] for c in ("red", "green", "blue", "alpha")], 1).astype(float), faces)


def sample(vertices, colours, faces, per_face=4):
    rng = np.random.default_rng(0)
    which = np.repeat(np.arange(len(faces)), per_face)
    root, share = np.sqrt(rng.random((len(which), 1))), rng.random((len(which), 1))
    weights = np.hstack([1 - root, root * (1 - share), root * share])[:, :, None]
    corners = faces[which]
    return ((weights * vertices[corners]).sum(1).astype(np.float32), (weights * colours[corners]).sum(1))


out, truth = sys.argv[1:3]
key = next(line for line in map(json.loads, open(f"{out}/frames.jsonl")) if line["key"])
mesh, colours, _ = read_ply(f"{out}/{key['file']}")
points, wanted = sample(*read_ply(f"{truth}/frame_{key['number']:04d}.ply"))
errors, middle = [], points.mean(0)
points, mesh = points - middle, mesh - middle  # so that products keep their digits
squares = (points ** 2).sum(1)
for start in range(0, len(mesh), 100):
    dist = squares - 2 * mesh[start:start + 100] @ points.T
    errors.append(np.abs(colours[start:start + 100, :3] - wanted[dist.argmin(1), :3]).mean(1))
seen = colours[:, 3] == 255
print(f"frame {key['number']}, {seen.mean():.3f} of the vertices seen, mean colour error",
      f"{np.concatenate(errors)[seen].mean():.2f}")

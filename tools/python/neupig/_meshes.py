"""The meshes that a run wrote, as arrays."""

from __future__ import annotations

import json
import os
import pathlib
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from ._library import Error, Status
from ._run import Motion, Path

_KINDS = {"char": "i1", "uchar": "u1", "short": "<i2", "ushort": "<u2", "int": "<i4", "uint": "<u4", "float": "<f4",
          "double": "<f8"}


class Mesh(NamedTuple):
    vertices: npt.NDArray[np.float64]  #: V x 3
    faces: npt.NDArray[np.uint32]  #: F x 3


def _header(data: bytes, path: pathlib.Path) -> tuple[dict[str, tuple[int, list[list[str]]]], int]:
    """Elements with their counts and properties, and where the data begins."""
    end = data.find(b"end_header\n")
    lines = [line.split() for line in data[:max(end, 0)].decode("ascii", "replace").splitlines()]
    if end < 0 or lines[:1] != [["ply"]] or ["format", "binary_little_endian", "1.0"] not in lines:
        raise Error(Status.BAD_INPUT, f"{path}: not a binary PLY as neupig writes it")
    elements: dict[str, tuple[int, list[list[str]]]] = {}
    name = ""
    for line in lines:
        if line[0] == "element":
            name = line[1]
            elements[name] = (int(line[2]), [])
        elif line[0] == "property":
            elements[name][1].append(line[1:])
    return elements, end + len(b"end_header\n")


def read_mesh(path: Path) -> Mesh:
    """A mesh file as neupig writes it (binary PLY with triangles)."""
    file = pathlib.Path(os.fsdecode(path))
    data = file.read_bytes()
    elements, at = _header(data, file)
    try:
        count, properties = elements["vertex"]
        rows = np.frombuffer(data, np.dtype([(p[1], _KINDS[p[0]]) for p in properties]), count, at)
        at += rows.nbytes
        face_count, face_properties = elements.get("face", (0, []))
        if face_count and [p[:3] for p in face_properties] != [["list", "uchar", "int"]]:
            raise Error(Status.BAD_INPUT, f"{file}: faces are not lists of corners alone")
        corners = np.frombuffer(data, np.dtype([("n", "u1"), ("corners", "<i4", 3)]), face_count, at)
    except (KeyError, ValueError) as failure:
        raise Error(Status.BAD_INPUT, f"{file}: {failure}") from failure
    if not (corners["n"] == 3).all():
        raise Error(Status.BAD_INPUT, f"{file}: a face has not three corners")
    return Mesh(np.stack([rows[a].astype(np.float64) for a in "xyz"], axis=1), corners["corners"].astype(np.uint32))


def load(output: Path) -> Motion:
    """All meshes of a run that is done, in the order of time; frames without a mesh are left out."""
    folder = pathlib.Path(os.fsdecode(output))
    try:
        lines = [json.loads(line) for line in (folder / "frames.jsonl").read_text(encoding="utf-8").splitlines()]
    except FileNotFoundError as failure:
        raise Error(Status.BAD_INPUT, f"{folder} holds no run that is done") from failure
    lines = [line for line in lines if line.get("file")]
    meshes = [read_mesh(folder / line["file"]) for line in lines]
    if not meshes:
        raise Error(Status.BAD_INPUT, f"{folder} holds no meshes")
    figures = [line.get("figures", {}) for line in lines]
    return Motion(np.array([line["number"] for line in lines], np.int64), np.stack([m.vertices for m in meshes]),
                  meshes[0].faces, np.array([f.get("point_dist_median", np.nan) for f in figures], np.float64),
                  np.array([f.get("coverage", np.nan) for f in figures], np.float64), None,
                  np.array([line.get("good", False) for line in lines], np.bool_))

"""The nearest point of a surface."""

from __future__ import annotations

import ctypes
from ctypes import POINTER, byref, c_float, c_uint32, c_void_p
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from . import _library as native
from ._closing import Closing
from ._library import Error, Status, check, lib

_HIT = np.dtype([("face", np.uint32), ("weights", np.float32, 3), ("dist_sq", np.float32)])


class Hits(NamedTuple):
    """For every point asked: the closest face, the barycentric weights of the closest point in it, and how far it is.
    A point that is not finite has face 2^32 - 1 and distance infinity."""

    faces: npt.NDArray[np.uint32]  #: N
    weights: npt.NDArray[np.float32]  #: N x 3
    distances: npt.NDArray[np.float32]  #: N


def _rows(array: npt.ArrayLike, kind: type, what: str) -> npt.NDArray[Any]:
    rows: npt.NDArray[Any] = np.ascontiguousarray(array, kind)
    if rows.ndim != 2 or rows.shape[1] != 3:
        raise Error(Status.USAGE, f"{what} must be N x 3, not {rows.shape}")
    return rows


class Surface(Closing):
    """A mesh that can be asked for its nearest point.  Asking is thread-safe and lets other Python threads run; ``move``
    refits the search tree and must not run beside a question."""

    def __init__(self, vertices: npt.ArrayLike, faces: npt.ArrayLike) -> None:
        self._handle = c_void_p()
        v, f = _rows(vertices, np.float32, "vertices"), _rows(faces, np.uint32, "faces")
        self._count = len(v)
        check(lib.npg_surface_open(byref(self._handle), v.ctypes.data_as(POINTER(c_float)), len(v),
                                   f.ctypes.data_as(POINTER(c_uint32)), len(f)))

    def closest(self, points: npt.ArrayLike) -> Hits:
        """The nearest surface point of each of N x 3 points."""
        p = _rows(points, np.float32, "points")
        hits = np.empty(len(p), _HIT)
        assert _HIT.itemsize == ctypes.sizeof(native.HitStruct)
        check(lib.npg_surface_closest(self._handle, hits.ctypes.data_as(POINTER(native.HitStruct)),
                                      p.ctypes.data_as(POINTER(c_float)), len(p)))
        return Hits(hits["face"].copy(), hits["weights"].copy(), np.sqrt(hits["dist_sq"]))

    def move(self, vertices: npt.ArrayLike) -> None:
        """Put the vertices elsewhere; the faces stay."""
        v = _rows(vertices, np.float32, "vertices")
        if len(v) != self._count:
            raise Error(Status.USAGE, f"the surface has {self._count} vertices, not {len(v)}")
        check(lib.npg_surface_move(self._handle, v.ctypes.data_as(POINTER(c_float))))

    def _free(self) -> None:
        if self._handle:
            lib.npg_surface_close(byref(self._handle))

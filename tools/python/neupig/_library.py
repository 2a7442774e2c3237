"""The shared library: where it is, its functions, and how a failure becomes an exception.

Follows pipeline/neupig.h; tests/delivery/python.bats compares the struct sizes and names of both.
"""

from __future__ import annotations

import ctypes
import enum
import os
import pathlib
import sys
from ctypes import (CFUNCTYPE, POINTER, Structure, c_char_p, c_double, c_float, c_int, c_int64, c_size_t,
                    c_ubyte, c_uint32, c_uint64, c_void_p)

VERSION = "0.1.0"


class Status(enum.IntEnum):
    """What a call of the library returned, as in neupig.h."""

    OK = 0
    END = 1
    STOPPED = 2
    PARTIAL = 3
    FAILED = -1
    USAGE = -2
    BAD_INPUT = -3
    DEVICE = -4
    DISK = -5
    MEMORY = -6
    DIVERGED = -7
    ABORTED = -8


#: Exit codes of the command, for those statuses that have one of their own.
EXIT_CODES = {1: Status.FAILED, 2: Status.USAGE, 3: Status.BAD_INPUT, 4: Status.DEVICE, 5: Status.DISK,
              6: Status.MEMORY, 7: Status.PARTIAL, 75: Status.STOPPED}


class Error(RuntimeError):
    """A failure.  ``status`` says of what class, ``message`` what, where and why."""

    def __init__(self, status: int, message: str) -> None:
        super().__init__(message)
        self.status = Status(status) if status in Status._value2member_map_ else Status.FAILED
        self.message = message

    def __str__(self) -> str:
        return f"{self.message} ({self.status.name.lower()})"


# ---- the structs ----

class OptionInfoStruct(Structure):
    _fields_ = [("struct_size", c_size_t), ("stage", c_char_p), ("name", c_char_p), ("help", c_char_p),
                ("default_text", c_char_p), ("choices", c_char_p), ("value_name", c_char_p), ("type", c_int),
                ("min", c_double), ("max", c_double), ("use", c_int)]


class FrameViewStruct(Structure):
    _fields_ = [("struct_size", c_size_t), ("index", c_int64), ("number", c_int64), ("path", c_char_p),
                ("point_count", c_size_t), ("points", POINTER(c_float)), ("normals", POINTER(c_float)),
                ("keep", POINTER(c_ubyte)), ("points_origin", c_double * 3), ("vertex_count", c_size_t),
                ("face_count", c_size_t), ("vertices", POINTER(c_float)), ("faces", POINTER(c_uint32)),
                ("vertices_origin", c_double * 3), ("vertices_unit", c_double), ("residual", c_double),
                ("coverage", c_double), ("colours", POINTER(c_ubyte)), ("vertex_colours", POINTER(c_ubyte))]


FrameFunction = CFUNCTYPE(c_int, c_void_p, POINTER(FrameViewStruct))


class CustomStageStruct(Structure):
    _fields_ = [("struct_size", c_size_t), ("name", c_char_p), ("after", c_char_p), ("user", c_void_p),
                ("frame", FrameFunction)]


class LogRecordStruct(Structure):
    _fields_ = [("struct_size", c_size_t), ("level", c_int), ("time_s", c_double), ("stage", c_char_p),
                ("frame", c_int64), ("message", c_char_p)]


class ProgressStruct(Structure):
    _fields_ = [("struct_size", c_size_t), ("stage", c_char_p), ("share", c_double), ("elapsed_s", c_double),
                ("left_s", c_double), ("frames_done", c_int64), ("frames", c_int64), ("step", c_int64),
                ("steps", c_int64), ("window", c_int64), ("windows", c_int64), ("loss", c_double)]


LogFunction = CFUNCTYPE(None, c_void_p, POINTER(LogRecordStruct))
ProgressFunction = CFUNCTYPE(None, c_void_p, POINTER(ProgressStruct))


class HooksStruct(Structure):
    _fields_ = [("struct_size", c_size_t), ("user", c_void_p), ("log", LogFunction), ("progress", ProgressFunction)]


class CloudStruct(Structure):
    _fields_ = [("struct_size", c_size_t), ("number", c_int64), ("point_count", c_size_t),
                ("points", POINTER(c_double)), ("normals", POINTER(c_float)), ("colours", POINTER(c_ubyte))]


class ResultStruct(Structure):
    _fields_ = [("struct_size", c_size_t), ("index", c_int64), ("number", c_int64), ("vertex_count", c_size_t),
                ("face_count", c_size_t), ("vertices", POINTER(c_double)), ("faces", POINTER(c_uint32)),
                ("residual", c_double), ("coverage", c_double), ("vertex_colours", POINTER(c_ubyte)),
                ("good", c_int)]


class CaptureFactsStruct(Structure):
    _fields_ = [("struct_size", c_size_t),
                *((name, c_size_t) for name in (
                    "frames", "missing", "unreadable", "with_normals", "points_least", "points_median", "points_most",
                    "points_total", "not_finite", "attention")),
                ("box_low", c_double * 3), ("box_high", c_double * 3), ("bytes", c_uint64), ("vertices", c_size_t),
                ("window", c_size_t), ("memory_bytes", c_double), ("disk_bytes", c_double), ("time_s", c_double),
                ("text", c_char_p), ("json", c_char_p)]


class EvalFiguresStruct(Structure):
    _fields_ = [("struct_size", c_size_t), ("frames", c_int64),
                *((name, c_double) for name in (
                    "cd", "cd_to_truth", "cd_from_truth", "nc", "f", "precision", "recall", "corr")),
                *((name, c_size_t) for name in ("vertices", "faces", "truth_vertices", "truth_faces")),
                *((name, c_double) for name in ("diagonal", "jitter", "edge", "rigidity", "bad_area")),
                ("constant_topology", c_int)]


EvalFunction = CFUNCTYPE(None, c_void_p, POINTER(EvalFiguresStruct))


class EvalSettingsStruct(Structure):
    _fields_ = [("struct_size", c_size_t), ("predicted", c_char_p), ("truth", c_char_p), ("frames", c_char_p),
                ("points_only", c_int), ("samples", c_size_t), ("tau", c_double), ("seed", c_uint64), ("user", c_void_p),
                ("frame", EvalFunction)]


class ApplySettingsStruct(Structure):
    _fields_ = [("struct_size", c_size_t), ("job", c_char_p), ("mesh", c_char_p), ("output", c_char_p),
                ("prefix", c_char_p), ("forms", c_char_p), ("fps_scale", c_int64), ("far_share", c_double),
                ("overwrite", c_int)]


class AppliedStruct(Structure):
    _fields_ = [("struct_size", c_size_t), ("frames", c_size_t), ("point_count", c_size_t), ("far_count", c_size_t),
                ("worst", c_size_t), ("worst_dist", c_double), ("worst_share", c_double)]


class ExportedStruct(Structure):
    _fields_ = [("struct_size", c_size_t), ("files", c_size_t), ("repeated", c_size_t)]


class HitStruct(Structure):
    _fields_ = [("face", c_uint32), ("weights", c_float * 3), ("dist_sq", c_float)]


# ---- the functions ----

_SLOT = POINTER(c_void_p)
_FUNCTIONS = {
    "npg_version": (c_char_p, []),
    "npg_error_text": (c_char_p, []),
    "npg_error_set": (c_int, [c_int, c_char_p]),
    "npg_memory_used": (c_size_t, []),
    "npg_memory_peak": (c_size_t, []),
    "npg_options_open": (c_int, [_SLOT]),
    "npg_options_close": (None, [_SLOT]),
    "npg_options_set": (c_int, [c_void_p, c_char_p, c_char_p]),
    "npg_options_get": (c_char_p, [c_void_p, c_char_p]),
    "npg_options_load": (c_int, [c_void_p, c_char_p]),
    "npg_options_load_job": (c_int, [c_void_p, c_char_p]),
    "npg_options_describe": (c_int, [c_size_t, POINTER(OptionInfoStruct)]),
    "npg_options_add_stage": (c_int, [c_void_p, POINTER(CustomStageStruct)]),
    "npg_run_open": (c_int, [_SLOT, c_void_p, POINTER(HooksStruct)]),
    "npg_run_push": (c_int, [c_void_p, POINTER(CloudStruct)]),
    "npg_run_wanted_number": (c_int, [c_void_p, POINTER(c_int64)]),
    "npg_run_finish": (c_int, [c_void_p]),
    "npg_run_pull": (c_int, [c_void_p, POINTER(POINTER(ResultStruct))]),
    "npg_result_close": (None, [POINTER(POINTER(ResultStruct))]),
    "npg_run_wait": (c_int, [c_void_p]),
    "npg_run_stop": (None, [c_void_p]),
    "npg_run_close": (None, [_SLOT]),
    "npg_capture_probe": (c_int, [POINTER(POINTER(CaptureFactsStruct)), c_void_p]),
    "npg_capture_facts_close": (None, [POINTER(POINTER(CaptureFactsStruct))]),
    "npg_eval": (c_int, [POINTER(EvalFiguresStruct), POINTER(EvalSettingsStruct)]),
    "npg_apply": (c_int, [POINTER(AppliedStruct), POINTER(ApplySettingsStruct)]),
    "npg_export": (c_int, [POINTER(ExportedStruct), c_char_p, c_char_p]),
    "npg_surface_open": (c_int, [_SLOT, POINTER(c_float), c_size_t, POINTER(c_uint32), c_size_t]),
    "npg_surface_move": (c_int, [c_void_p, POINTER(c_float)]),
    "npg_surface_closest": (c_int, [c_void_p, POINTER(HitStruct), POINTER(c_float), c_size_t]),
    "npg_surface_close": (None, [_SLOT]),
}


def _tree() -> pathlib.Path | None:
    """The source tree this module lies in, or was installed from (backend.py leaves its path beside the module)."""
    here = pathlib.Path(__file__).resolve().parent
    note = here / "source_tree.txt"
    tree = pathlib.Path(note.read_text(encoding="utf-8").rstrip("\n")) if note.exists() else here.parents[2]
    return tree if (tree / "pipeline" / "neupig.h").exists() else None


def _candidates() -> list[str]:
    """Where the library may be: as told, in the wheel, the build of the source tree, then where libraries are."""
    told = os.environ.get("NEUPIG_LIBRARY")
    if told:
        return [told]
    carried = pathlib.Path(__file__).resolve().parent / "lib" / "libneupig.so.0"
    if carried.exists():
        return [str(carried)]
    tree = _tree()
    built = [str(tree / "build" / "libneupig.so.0")] if tree else []
    return [*built, "libneupig.so.0", f"{sys.prefix}/lib/libneupig.so.0", "/usr/local/lib/libneupig.so.0"]


def _not_found(tried: list[str]) -> str:
    """What to do about it, and where was looked."""
    tree = _tree()
    build = (f"build it in {tree} with: cmake --build build --target neupig_shared" if tree
             else "build it in the source tree with: cmake --build build --target neupig_shared")
    return (f"the library libneupig.so.0 is not found; {build}, or set NEUPIG_LIBRARY to its path; looked for "
            + "; ".join(tried))


def _load() -> ctypes.CDLL:
    tried = []
    for path in _candidates():
        try:
            library = ctypes.CDLL(path)
            break
        except OSError as failure:
            tried.append(f"{path} ({failure})")
    else:
        raise ImportError(_not_found(tried))
    for name, (result, arguments) in _FUNCTIONS.items():
        function = getattr(library, name)
        function.restype, function.argtypes = result, arguments
    found = library.npg_version().decode()
    if found.split(".")[:2] != VERSION.split(".")[:2]:
        raise ImportError(f"this module is of neupig {VERSION}, the library of {found}")
    return library


class _DlInfo(Structure):
    _fields_ = [("dli_fname", c_char_p), ("dli_fbase", c_void_p), ("dli_sname", c_char_p), ("dli_saddr", c_void_p)]


def _path_of(library: ctypes.CDLL) -> pathlib.Path:
    """The file the library was loaded from, whatever path it was found by."""
    info = _DlInfo()
    dladdr = ctypes.CDLL(None).dladdr
    dladdr.argtypes, dladdr.restype = [c_void_p, POINTER(_DlInfo)], c_int
    if not dladdr(ctypes.cast(library.npg_version, c_void_p), ctypes.byref(info)) or not info.dli_fname:
        raise ImportError("can't tell which file libneupig was loaded from")
    return pathlib.Path(os.fsdecode(info.dli_fname)).resolve()


lib = _load()
library_path = _path_of(lib)


def check(status: int) -> Status:
    """The status, or the exception that a failure is.  The text belongs to the calling thread."""
    if status < 0:
        raise Error(status, lib.npg_error_text().decode(errors="replace"))
    return Status(status)

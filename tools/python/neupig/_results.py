"""What a capture holds, and what can be done with results: probe, eval, apply and export, through the library."""

from __future__ import annotations

import json
import math
import os
import pathlib
from collections.abc import Iterable
from ctypes import POINTER, byref, c_void_p, sizeof
from typing import Any

from . import _library as native
from ._library import Error, Status, check, lib
from ._options import Options, nearest
from ._run import Path

_EVAL = {"samples": 100000, "tau": 0.005, "seed": 0, "frames": "", "points_only": False}
_APPLY = {"export": "", "fps_scale": 1, "far": 0.05, "prefix": "frame", "overwrite": False}


def _take(verb: str, given: dict[str, object], defaults: dict[str, Any]) -> dict[str, Any]:
    for name in given:
        if name not in defaults:
            raise Error(Status.USAGE, f"{verb}: there is no option {name}{nearest(name, defaults)}")
    return {**defaults, **given}


def probe(input: Path, **options: object) -> dict[str, Any]:
    """Look at a capture, as a run with these options would: counts, boxes, gaps, faults, and what it would cost."""
    facts = POINTER(native.CaptureFactsStruct)()
    asked = Options({**options, "input": input})  # lives until the call is done
    try:
        check(lib.npg_capture_probe(byref(facts), asked.handle))
        return dict(json.loads(facts.contents.json))
    finally:
        lib.npg_capture_facts_close(byref(facts))


def _figures(of: native.EvalFiguresStruct) -> dict[str, Any]:
    names = {"CD": "cd", "CD_pred_to_gt": "cd_to_truth", "CD_gt_to_pred": "cd_from_truth", "NC": "nc", "F": "f",
             "precision": "precision", "recall": "recall", "Corr": "corr"}
    return {name: _number(getattr(of, member)) for name, member in names.items()}


def _number(value: float) -> float | None:
    return value if math.isfinite(value) else None


def eval(predicted: Path, truth: Path, **options: object) -> dict[str, Any]:
    """Measure a mesh sequence (or the output folder of a run) against a ground truth.  Options: samples, tau, seed,
    frames ("a:b:step", or places), points_only.  What can't be told is None."""
    o = _take("eval", options, _EVAL)
    per_frame: list[dict[str, Any]] = []

    def note(_user: c_void_p, figures: Any) -> None:
        per_frame.append({"frame": figures.contents.frames, **_figures(figures.contents)})

    callback = native.EvalFunction(note)
    all_ = native.EvalFiguresStruct(struct_size=sizeof(native.EvalFiguresStruct))
    check(lib.npg_eval(byref(all_), byref(native.EvalSettingsStruct(
        struct_size=sizeof(native.EvalSettingsStruct), predicted=os.fsencode(predicted), truth=os.fsencode(truth),
        frames=str(o["frames"]).encode(), points_only=bool(o["points_only"]), samples=int(o["samples"]),
        tau=float(o["tau"]), seed=int(o["seed"]), frame=callback))))
    return {"frames": all_.frames, "samples": int(o["samples"]), "tau": float(o["tau"]), **_figures(all_),
            "pred_vertices": all_.vertices, "pred_faces": all_.faces, "gt_vertices": all_.truth_vertices,
            "gt_faces": all_.truth_faces, "pred_constant_topology": bool(all_.constant_topology),
            **{name: _number(getattr(all_, name)) for name in ("diagonal", "jitter", "edge", "rigidity", "bad_area")},
            "per_frame": per_frame}


def apply(job: Path, mesh: Path, output: Path, **options: object) -> pathlib.Path:
    """Carry another mesh, or points, through a finished run; returns the folder of the meshes.  Options: export (formats
    with commas), fps_scale, far, prefix, overwrite."""
    o = _take("apply", options, _APPLY)
    applied = native.AppliedStruct(struct_size=sizeof(native.AppliedStruct))
    check(lib.npg_apply(byref(applied), byref(native.ApplySettingsStruct(
        struct_size=sizeof(native.ApplySettingsStruct), job=os.fsencode(job), mesh=os.fsencode(mesh),
        output=os.fsencode(output), prefix=os.fsencode(o["prefix"]), forms=str(o["export"]).encode(),
        fps_scale=int(o["fps_scale"]), far_share=float(o["far"]), overwrite=bool(o["overwrite"])))))
    return pathlib.Path(os.fsdecode(output))


def export(output: Path, forms: str | Iterable[str]) -> int:
    """Write other formats of a finished run: ``export("out", "glb,usda")``.  How many files were made: none of what lies
    there already."""
    made = native.ExportedStruct(struct_size=sizeof(native.ExportedStruct))
    names = forms if isinstance(forms, str) else ",".join(forms)
    check(lib.npg_export(byref(made), os.fsencode(output), names.encode()))
    return int(made.files)

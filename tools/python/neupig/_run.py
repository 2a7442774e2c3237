"""Runs: from files to files, or arrays in and arrays out."""

from __future__ import annotations

import atexit
import ctypes
import json
import logging
import os
import pathlib
import threading
import weakref
from collections.abc import Callable, Iterable, Iterator, Sequence
from ctypes import POINTER, byref, c_double, c_float, c_int64, c_ubyte, c_void_p, sizeof
from dataclasses import dataclass
from typing import Any, NamedTuple, TypeVar, Union

import numpy as np
import numpy.typing as npt

from . import _library as native
from ._closing import Closing
from ._library import Error, Status, check, lib
from ._options import Options

Path = Union[str, "os.PathLike[str]"]
Result = TypeVar("Result")

_log = logging.getLogger("neupig")
_LOOK_S = 0.1
_LEVELS = (logging.ERROR, logging.WARNING, logging.INFO, logging.DEBUG)


class Progress(NamedTuple):
    """How far a run is.  ``left_s`` and ``frames`` are negative while they can't be told."""

    stage: str
    share: float
    elapsed_s: float
    left_s: float
    frames_done: int
    frames: int
    step: int
    steps: int
    window: int
    windows: int
    loss: float


@dataclass(frozen=True)
class Frame:
    """One frame of the moving mesh."""

    index: int  #: position in the sequence
    number: int  #: the number in its file's name, or pushed
    vertices: npt.NDArray[np.float64]  #: V x 3, world coordinates
    faces: npt.NDArray[np.uint32]  #: F x 3, the same in every frame
    residual: float  #: median distance points -> surface, in diagonals of the box
    coverage: float  #: share of the surface that has points near it
    colours: npt.NDArray[np.uint8] | None = None  #: V x 4 RGBA, sRGB; None where the points have no colours
    good: bool = True  #: above the quality bar, by itself


class Motion(NamedTuple):
    """A moving mesh in the order of time."""

    numbers: npt.NDArray[np.int64]  #: T
    vertices: npt.NDArray[np.float64]  #: T x V x 3
    faces: npt.NDArray[np.uint32]  #: F x 3
    residuals: npt.NDArray[np.float64]  #: T
    coverages: npt.NDArray[np.float64]  #: T
    colours: npt.NDArray[np.uint8] | None = None  #: V x 4 of the reference; with colour="frames" T x V x 4
    good: npt.NDArray[np.bool_] | None = None  #: T, above the quality bar


class Outcome(NamedTuple):
    """How a run over files ended: OK, or PARTIAL with frames skipped or below the quality bar."""

    status: Status
    output: pathlib.Path
    done: dict[str, Any]  #: what done.json says: files with checksums, options, figures


class FrameView:
    """A frame on its way through the chain, for a Stage.  Arrays are views of the run's own memory, good until the
    callback returns: change them in place, set ``keep`` to False to drop points.

    A point in the world is ``points_origin + points[i]``, a vertex ``vertices_origin + vertices_unit * vertices[v]``.
    """

    def __init__(self, view: native.FrameViewStruct) -> None:
        n, v, f = view.point_count, view.vertex_count, view.face_count
        self.index: int = view.index
        self.number: int = view.number
        self.path: str | None = os.fsdecode(view.path) if view.path else None
        self.points: npt.NDArray[np.float32] = _view(view.points, n)
        self.normals: npt.NDArray[np.float32] | None = _view(view.normals, n) if view.normals else None
        self.keep: npt.NDArray[np.bool_] = (
            np.ctypeslib.as_array(view.keep, (n,)).view(np.bool_) if n else np.zeros(0, np.bool_))
        self.points_origin: npt.NDArray[np.float64] = np.array(view.points_origin)
        self.vertices: npt.NDArray[np.float32] | None = _view(view.vertices, v) if view.vertices else None
        self.faces: npt.NDArray[np.uint32] | None = (
            np.ctypeslib.as_array(view.faces, (f, 3)) if view.faces else None)
        self.vertices_origin: npt.NDArray[np.float64] = np.array(view.vertices_origin)
        self.vertices_unit: float = view.vertices_unit
        self.residual: float = view.residual
        self.coverage: float = view.coverage
        self.colours: npt.NDArray[np.uint8] | None = _colours(view.colours, n)
        self.vertex_colours: npt.NDArray[np.uint8] | None = _colours(view.vertex_colours, v)


def _view(pointer: Any, count: int) -> npt.NDArray[np.float32]:
    return np.ctypeslib.as_array(pointer, (count, 3)) if count else np.zeros((0, 3), np.float32)


def _colours(pointer: Any, count: int) -> npt.NDArray[np.uint8] | None:
    return np.ctypeslib.as_array(pointer, (count, 4)) if pointer and count else None


class Stage(NamedTuple):
    """A custom stage, after one of ingest, outlier, keyframe, mesh, align, optimize, evaluate, export.

    ``frame`` is called on a thread of the run.  After ingest and outlier it sees every frame up to four times and must
    do the same each time.  An exception in it ends the run and is raised again by ``wait``.
    """

    name: str
    after: str
    frame: Callable[[FrameView], None]


def _rgba(colours: npt.ArrayLike, count: int) -> npt.NDArray[np.uint8]:
    given = np.asarray(colours)
    if given.dtype != np.uint8 or given.ndim != 2 or given.shape[0] != count or given.shape[1] not in (3, 4):
        raise Error(Status.USAGE, f"colours must be {count} x 3 or x 4 bytes, not {given.shape} of {given.dtype}")
    rgba = np.full((count, 4), 255, np.uint8)
    rgba[:, :given.shape[1]] = given
    return rgba


def _aside(work: Callable[[], Result], interrupted: Callable[[], None]) -> Result:
    """What work() returns or raises, done on a thread of its own if this is the main one: only that gets Ctrl-C, and gets
    none while it is inside the library.  After Ctrl-C, interrupted() is called and work() goes on by itself."""
    if threading.current_thread() is not threading.main_thread():
        return work()
    outcome: list[Result] = []
    failure: list[BaseException] = []
    is_over = threading.Lock()

    def body() -> None:
        try:
            outcome.append(work())
        except BaseException as error:  # handed to the caller's thread
            failure.append(error)
        finally:
            is_over.release()

    try:
        is_over.acquire()
        threading.Thread(target=body, daemon=True).start()
        # a signal after Python's last look for one, before the wait, is seen only when that ends
        while not is_over.acquire(timeout=_LOOK_S):
            pass
    except BaseException:
        interrupted()
        raise
    if failure:
        raise failure[0]
    return outcome[0]


class Run(Closing):
    """A run: frames come from files (``input``), or are pushed; results go to a folder (``output``), are pulled
    (``pull=True``), or both.

    >>> with Run(pull=True, epochs=100) as run:
    ...     # push from one thread, pull in another: each waits for the other
    ...     for mesh in run: ...

    The log goes to the logger "neupig"; ``progress`` is called with a Progress on a thread of the run.
    """

    def __init__(self, *, progress: Callable[[Progress], None] | None = None, stages: Sequence[Stage] = (),
                 options: Options | None = None, **values: object) -> None:
        self._closing = threading.Lock()
        self._guard = threading.Condition()  # of _handle and _callers; not for the main thread, but at the end
        self._callers = 0
        self._handle = c_void_p()
        self._failure: BaseException | None = None
        chosen = options or Options()
        for name, value in values.items():
            chosen.set(name, value)
        self._callbacks: list[Any] = []  # must live as long as the run
        for stage in stages:
            self._add_stage(chosen, stage)
        self._hooks = self._make_hooks(progress)
        _open_runs.add(self)
        check(lib.npg_run_open(byref(self._handle), chosen.handle, byref(self._hooks)))

    def _call(self, work: Callable[[c_void_p], Result]) -> Result:
        """Call functions of the library that may block: Ctrl-C stops the run and goes on at once, close() waits until the
        call is over."""
        def counted() -> Result:
            with self._guard:
                handle = self._handle
                if not handle:
                    raise Error(Status.USAGE, "the run is closed")
                self._callers += 1
            try:
                return work(handle)
            finally:
                with self._guard:
                    self._callers -= 1
                    self._guard.notify_all()

        return _aside(counted, self.stop)

    # ---- callbacks ----

    def _add_stage(self, options: Options, stage: Stage) -> None:
        def frame(_user: object, view: Any) -> int:
            try:
                stage.frame(FrameView(view.contents))
                return Status.OK
            except BaseException as failure:  # nothing may pass through C
                self._failure = failure
                words = f"{type(failure).__name__}: {failure}"
                return int(lib.npg_error_set(Status.FAILED, words.encode(errors="replace")))

        function = native.FrameFunction(frame)
        self._callbacks.append(function)
        given = native.CustomStageStruct(sizeof(native.CustomStageStruct), stage.name.encode(), stage.after.encode(), None,
                                      function)
        check(lib.npg_options_add_stage(options.handle, byref(given)))

    def _make_hooks(self, progress: Callable[[Progress], None] | None) -> native.HooksStruct:
        def log(_user: object, record: Any) -> None:
            r = record.contents
            _log.log(_LEVELS[r.level], "%s: %s", r.stage.decode(), r.message.decode(errors="replace"))

        def tell(_user: object, record: Any) -> None:
            p = record.contents
            if progress:
                progress(Progress(p.stage.decode(), p.share, p.elapsed_s, p.left_s, p.frames_done, p.frames, p.step,
                                  p.steps, p.window, p.windows, p.loss))

        functions = (native.LogFunction(log), native.ProgressFunction(tell))
        return native.HooksStruct(sizeof(native.HooksStruct), None, *functions)

    def _check(self, status: int) -> Status:
        """As check(), but what a custom stage raised is raised again."""
        try:
            return check(status)
        except Error as error:
            if self._failure is not None:
                raise self._failure from error
            raise

    # ---- frames in, meshes out ----

    def push(self, points: npt.ArrayLike, normals: npt.ArrayLike | None = None,
             colours: npt.ArrayLike | None = None, *, number: int) -> None:
        """Give the run its next frame: N x 3 points in the world, N x 3 normals, N x 3 or N x 4 colours (bytes, sRGB;
        alpha 0: not known).  Waits while the run is busy.  Numbers must grow.  Copies."""
        p = np.ascontiguousarray(points, np.float64)
        n = None if normals is None else np.ascontiguousarray(normals, np.float32)
        if p.ndim != 2 or p.shape[1] != 3 or (n is not None and n.shape != p.shape):
            raise Error(Status.USAGE, f"points must be N x 3 and normals the same, not {p.shape}"
                                      + ("" if n is None else f" and {n.shape}"))
        c = None if colours is None else _rgba(colours, len(p))
        cloud = native.CloudStruct(sizeof(native.CloudStruct), number, len(p), p.ctypes.data_as(POINTER(c_double)),
                                   None if n is None else n.ctypes.data_as(POINTER(c_float)),
                                   None if c is None else c.ctypes.data_as(POINTER(c_ubyte)))
        self._call(lambda handle: self._check(lib.npg_run_push(handle, byref(cloud))))

    def wanted_number(self) -> int | None:
        """The number of the first frame that a run with ``output`` and without ``pull`` wants pushed: those with smaller
        numbers were solved by an earlier run of the same job that was broken off.  None: nothing was kept, push all."""
        number = c_int64()
        self._call(lambda handle: self._check(lib.npg_run_wanted_number(handle, byref(number))))
        return None if number.value == -(1 << 63) else number.value

    def finish(self) -> None:
        """Say that no more frames will be pushed."""
        self._call(lambda handle: self._check(lib.npg_run_finish(handle)))

    def pull(self) -> Frame | None:
        """The next finished frame, None after the last.  Frames come as windows close, not in time order."""
        return self._call(self._pull)

    def _pull(self, handle: c_void_p) -> Frame | None:
        result = POINTER(native.ResultStruct)()
        status = self._check(lib.npg_run_pull(handle, byref(result)))
        if status is not Status.OK:
            if status is Status.STOPPED:
                raise Error(status, "stopped on request")
            return None
        r = result.contents
        try:
            return Frame(r.index, r.number, np.ctypeslib.as_array(r.vertices, (r.vertex_count, 3)).copy(),
                         np.ctypeslib.as_array(r.faces, (r.face_count, 3)).copy(), r.residual, r.coverage,
                         None if (c := _colours(r.vertex_colours, r.vertex_count)) is None else c.copy(), bool(r.good))
        finally:
            lib.npg_result_close(byref(result))

    def __iter__(self) -> Iterator[Frame]:
        while (frame := self.pull()) is not None:
            yield frame

    # ---- the end ----

    def wait(self) -> Status:
        """Wait for the end: OK, PARTIAL or STOPPED; a failure is raised."""
        return self._call(lambda handle: self._check(lib.npg_run_wait(handle)))

    def stop(self) -> None:
        """Ask the run to stop soon; from any thread."""
        if self._handle:
            lib.npg_run_stop(self._handle)

    def close(self) -> None:
        """Stop the run if it is going on and free everything, once calls that other threads are in have ended.  None may
        be about to call stop."""
        _aside(self._free, self.stop)

    def _free(self) -> None:
        with self._closing:  # a second one waits for the first
            with self._guard:
                handle, self._handle = self._handle, c_void_p()
                if handle:
                    lib.npg_run_stop(handle)
                    self._guard.wait_for(lambda: not self._callers)
            lib.npg_run_close(byref(handle))


_open_runs: weakref.WeakSet[Run] = weakref.WeakSet()


@atexit.register
def _free_all() -> None:
    """What Ctrl-C left open, before the interpreter is gone that a run's threads call back into."""
    for run in list(_open_runs):
        run._free()


def _wait_for_files(run: Run, output: Path) -> Outcome:
    with run:
        status = run.wait()
    if status is Status.STOPPED:
        raise Error(status, "stopped on request")
    folder = pathlib.Path(os.fsdecode(output))
    return Outcome(status, folder, json.loads((folder / "done.json").read_text(encoding="utf-8")))


def run(input: Path, output: Path, *, progress: Callable[[Progress], None] | None = None,
        stages: Sequence[Stage] = (), **options: object) -> Outcome:
    """Turn a capture (folder, pattern, list file) into a folder of meshes, as ``neupig run`` does.

    Options are those of the command with _ for -: ``run("capture", "out", epochs=100, max_memory=2000)``.  A run that
    was stopped or killed goes on where it was when it is started again."""
    chosen = Options({**options, "input": input, "output": output})
    return _wait_for_files(Run(options=chosen, progress=progress, stages=stages), output)


def append(output: Path, *, input: Path | None = None,
           progress: Callable[[Progress], None] | None = None, stages: Sequence[Stage] = ()) -> Outcome:
    """Go on with frames that came since the run into ``output`` was done, as ``neupig append`` does; ``input`` says where
    the frames are now if they were moved.  A job that was broken off is first brought to its end."""
    def options() -> Options:
        chosen = Options()
        chosen.load_job(output)
        if input is not None:
            chosen.set("input", input)
        return chosen

    if not os.path.exists(os.path.join(output, "done.json")):
        _wait_for_files(Run(options=options(), progress=progress, stages=stages), output)
    return _wait_for_files(Run(options=options(), progress=progress, stages=stages, append=True), output)


Cloud = Union[npt.ArrayLike, tuple[npt.ArrayLike, npt.ArrayLike],
              tuple[npt.ArrayLike, Union[npt.ArrayLike, None], npt.ArrayLike]]


def _push_all(run: Run, frames: Iterable[Cloud], failures: list[BaseException]) -> None:
    try:
        for number, frame in enumerate(frames):
            if isinstance(frame, tuple):
                run.push(*frame, number=number)
            else:
                run.push(frame, number=number)
        run.finish()
    except BaseException as failure:  # raised again where the meshes are pulled
        failures.append(failure)
        run.stop()


def reconstruct(frames: Iterable[Cloud], *, progress: Callable[[Progress], None] | None = None,
                stages: Sequence[Stage] = (), **options: object) -> Motion:
    """Arrays in, a moving mesh out.  ``frames`` gives N x 3 points, (points, normals) or (points, normals or None,
    colours), in time order; it is read on a
    thread of its own, as fast as the run can take it.  Keyframe and reference are made from the look-ahead, as for a
    live source: ``look_ahead=N`` with as many as there are gives what files give.  When the run fails this returns once ``frames`` has given its next
    frame."""
    failures: list[BaseException] = []
    with Run(options=Options({**options, "pull": True}), progress=progress, stages=stages) as run:
        pusher = threading.Thread(target=_push_all, args=(run, frames, failures), daemon=True)
        pusher.start()
        try:
            meshes = sorted(run, key=lambda mesh: mesh.index)
            run.wait()
        except BaseException as error:
            run.stop()
            pusher.join()
            if failures and isinstance(error, Error) and error.status is Status.STOPPED:
                raise failures[0] from None  # what made it stop
            raise
        pusher.join()
    if failures:
        raise failures[0]
    if not meshes:
        raise Error(Status.BAD_INPUT, "no frame got a mesh")
    all_colours = [m.colours for m in meshes if m.colours is not None]
    colours = all_colours[0] if all_colours else None
    if colours is not None and any(not np.array_equal(each, colours) for each in all_colours):
        colours = np.stack(all_colours)
    return Motion(np.array([m.number for m in meshes], np.int64), np.stack([m.vertices for m in meshes]),
                  meshes[0].faces, np.array([m.residual for m in meshes]), np.array([m.coverage for m in meshes]), colours,
                  np.array([m.good for m in meshes]))

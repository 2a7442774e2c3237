"""Options: what there is to set, and how keyword arguments become texts."""

from __future__ import annotations

import ctypes
import difflib
import json
import os
from collections.abc import Iterable, Iterator, Mapping
from typing import NamedTuple

from ._library import Error, OptionInfoStruct, Status, check, lib

_USES = ("command", "method", "part", "program")
_TYPES = ("flag", "int", "real", "choice", "text")


class Option(NamedTuple):
    """One option of a run, as ``neupig help run`` lists it."""

    stage: str
    name: str
    help: str
    default: str
    type: str
    choices: tuple[str, ...]
    min: float
    max: float
    use: str  # "command", "method" (a key of the method), "part" (of a list, as bars.residual) or "program"


def options() -> Iterator[Option]:
    """All options that ``run``, ``reconstruct`` and ``Run`` take."""
    info = OptionInfoStruct(struct_size=ctypes.sizeof(OptionInfoStruct))
    index = 0
    while check(lib.npg_options_describe(index, ctypes.byref(info))) is Status.OK:
        choices = tuple(info.choices.decode().split("|")) if info.choices else ()
        yield Option(info.stage.decode(), info.name.decode(), info.help.decode(), info.default_text.decode(),
                     _TYPES[info.type], choices, info.min, info.max, _USES[info.use])
        index += 1


def nearest(name: str, names: Iterable[str]) -> str:
    """For the end of a message: "; did you mean frames?", where one of the names is near."""
    near = difflib.get_close_matches(name, names, 1)
    return f"; did you mean {near[0]}?" if near else ""


def text_of(value: object) -> bytes:
    """A value as the option tables write it."""
    if isinstance(value, bool):
        return b"yes" if value else b"no"
    if isinstance(value, Mapping):  # a method
        return json.dumps(value).encode()
    if isinstance(value, os.PathLike):
        return os.fsencode(value)
    return value if isinstance(value, bytes) else os.fsencode(str(value))


class Options:
    """The library's options object.  Names may be written with _ for -."""

    def __init__(self, values: Mapping[str, object] = {}) -> None:
        self.handle = ctypes.c_void_p()
        check(lib.npg_options_open(ctypes.byref(self.handle)))
        for name, value in values.items():
            self.set(name, value)

    def set(self, name: str, value: object) -> None:
        try:
            check(lib.npg_options_set(self.handle, name.replace("_", "-").encode(), text_of(value)))
        except Error as failure:
            if not failure.message.startswith("there is no option"):
                raise
            known = ["progress", "stages", *(option.name.replace("-", "_") for option in options())]
            raise Error(failure.status, f"there is no option {name}{nearest(name, known)}") from None

    def get(self, name: str) -> str:
        text = lib.npg_options_get(self.handle, name.replace("_", "-").encode())
        if text is None:
            raise KeyError(name)
        return os.fsdecode(text)

    def load(self, path: str | os.PathLike[str]) -> None:
        """Options from a JSON file."""
        check(lib.npg_options_load(self.handle, os.fsencode(path)))

    def load_job(self, folder: str | os.PathLike[str]) -> None:
        """The options that the job in a folder was begun with."""
        check(lib.npg_options_load_job(self.handle, os.fsencode(folder)))

    def __del__(self) -> None:
        if getattr(self, "handle", None):
            lib.npg_options_close(ctypes.byref(self.handle))

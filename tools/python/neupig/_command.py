"""The verbs that live in the command alone: found beside the library, started, their failures raised."""

from __future__ import annotations

import functools
import os
import pathlib
import shutil
import subprocess
import sys
from collections.abc import Iterable
from typing import NamedTuple

from ._library import EXIT_CODES, VERSION, Error, Status, library_path
from ._options import text_of
from ._run import Path


@functools.cache
def command_path() -> str:
    """The command ``neupig`` that belongs to the library: $NEUPIG_COMMAND, beside it (a build folder), in the bin of its
    prefix, or on the PATH."""
    told = os.environ.get("NEUPIG_COMMAND")
    folder = library_path.parent
    near = [folder / "neupig", folder.parent / "bin" / "neupig", folder.parent.parent / "bin" / "neupig"]
    found = told or next((str(p) for p in near if os.access(p, os.X_OK) and p.is_file()), None) or shutil.which("neupig")
    if not found:
        raise Error(Status.FAILED, f"the command neupig is neither near {library_path} nor on the PATH; say where it is "
                                   "with NEUPIG_COMMAND")
    said = subprocess.run([found, "version"], capture_output=True, text=True, check=False).stdout.split()
    if said[1:2] != [VERSION]:
        raise Error(Status.FAILED, f"{found} is not the command of neupig {VERSION}")
    return found


def main() -> None:
    """The command as a wheel brings it that carries it (make_wheel.py)."""
    os.execv(pathlib.Path(__file__).resolve().parent / "lib" / "neupig", ["neupig", *sys.argv[1:]])


def command(verb: str, *operands: Path, **options: object) -> str:
    """Run any verb of the command and return what it printed: ``command("doctor")``.  Options as keywords with _ for -.
    Exit code 7 (done, but look closer) is no failure; every other but 0 is raised as an Error."""
    words: list[str | bytes] = [command_path(), verb]
    for name, value in options.items():
        words.append(b"--" + name.replace("_", "-").encode() + b"=" + text_of(value))
    words.append("--")
    words.extend(os.fsencode(o) for o in operands)
    ended = subprocess.run(words, capture_output=True, check=False)
    if ended.returncode not in (0, 7):
        said = ended.stderr.decode(errors="replace").strip().splitlines()
        raise Error(EXIT_CODES.get(ended.returncode, Status.FAILED),
                    said[-1] if said else f"neupig {verb} ended with {ended.returncode}")
    return ended.stdout.decode(errors="replace")


class Capture(NamedTuple):
    """A made capture and its exact truth."""

    points: pathlib.Path
    truth: pathlib.Path


def synth(output: Path, **options: object) -> Capture:
    """Make a capture with an exact ground truth: ``synth("demo", frames=12, points=5000, noise=0.1)``."""
    command("synth", output=output, **options)
    folder = pathlib.Path(os.fsdecode(output))
    return Capture(folder / "points", folder / "truth")


def render(files: Path | Iterable[Path], output: Path, **options: object) -> pathlib.Path:
    """Draw meshes or clouds (files or folders) into one PNG."""
    several = [files] if isinstance(files, (str, os.PathLike)) else list(files)
    command("render", *several, output=output, **options)
    return pathlib.Path(os.fsdecode(output))

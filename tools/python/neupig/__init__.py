"""neupig: one moving mesh from a long sequence of point clouds.

    import neupig

    outcome = neupig.run("capture/", "out/", epochs=100)     # files in, files out
    motion = neupig.load("out/")                             # motion.vertices: T x V x 3
    motion = neupig.reconstruct(list_of_point_arrays)        # arrays in, arrays out

``run``, ``append``, ``reconstruct``, ``Run``, ``Surface``, ``probe``, ``eval``, ``apply`` and ``export`` work in this process,
through the shared library.  ``synth`` and ``render`` start the command ``neupig`` that lies beside the library.  Failures are
raised as ``Error`` with a ``status`` and a ``message``.
"""

from ._command import Capture, command, command_path, render, synth
from ._library import VERSION as __version__
from ._library import Error, Status, library_path
from ._meshes import Mesh, load, read_mesh
from ._options import Option, Options, options
from ._results import apply, eval, export, probe
from ._run import Frame, FrameView, Motion, Outcome, Progress, Run, Stage, append, reconstruct, run
from ._surface import Hits, Surface

__all__ = [
    "Capture", "Error", "Frame", "FrameView", "Hits", "Mesh", "Motion", "Option", "Options", "Outcome", "Progress", "Run",
    "Stage", "Status", "Surface", "__version__", "append", "apply", "command", "command_path", "eval", "export", "library_path",
    "load", "options", "probe", "read_mesh", "reconstruct", "render", "run", "synth",
]

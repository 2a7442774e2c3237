#!/usr/bin/env python3
"""A wheel that carries all it needs: module, library, command, and every library that these load.

    make_wheel.py BUILD [-o FOLDER]      BUILD: a build folder with all of the programs; FOLDER: here

It installs with pip on any Linux whose C library is as new as this machine's, without a system package.  Libraries are
taken from the system with their licences; those of the C and C++ runtime stay outside, as is the rule of such wheels.
Needs patchelf (a Debian package), so that the copies find each other, and dpkg for the licences.
"""

import argparse
import pathlib
import platform
import shutil
import subprocess
import sys
import tempfile

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
import backend

PROGRAMS = ("neupig", "neupig-poisson", "neupig-devices")
# What PEP 600 lets a wheel expect of every system.
OF_THE_SYSTEM = ("ld-linux", "libc.so", "libm.so", "libdl.so", "libpthread.so", "librt.so", "libstdc++.so", "libgcc_s.so")


def run(*words: str) -> str:
    return subprocess.run(words, check=True, capture_output=True, text=True).stdout


def needs_of(file: pathlib.Path) -> dict[str, pathlib.Path]:
    """Name and place of each library that a program loads, and those load in turn."""
    found = {}
    for line in run("ldd", str(file)).splitlines():
        words = line.split()
        if "not found" in line:
            sys.exit(f"{file}: {line.strip()}")
        if "=>" in words and not words[0].startswith(OF_THE_SYSTEM):
            found[words[0]] = pathlib.Path(words[2])
    return found


def licences_of(libraries: list[pathlib.Path]) -> dict[str, bytes]:
    """The copyright files of their packages, each by its package's name."""
    places = {library: [pathlib.Path(str(path).removeprefix(merged)) for path in (library, library.resolve()) for merged in ("", "/usr")]
              for library in libraries}
    # One question for all of them: each has dpkg read the lists of all packages.
    asked = [str(path) for paths in places.values() for path in paths]
    said = subprocess.run(["dpkg-query", "-S", *asked], capture_output=True, text=True, check=False).stdout
    package_at = {path: names.split(":")[0] for names, _, path in (line.rpartition(": ") for line in said.splitlines())}
    found = {}
    for library, paths in places.items():
        package = next((package_at[str(path)] for path in paths if str(path) in package_at), "")
        licence = pathlib.Path("/usr/share/doc") / package / "copyright"
        if not package or not licence.exists():
            sys.exit(f"{library}: no licence in /usr/share/doc/{package}")
        found[f"{package}.txt"] = licence.read_bytes()
    return found


def gather(build: pathlib.Path, folder: pathlib.Path) -> dict[str, bytes]:
    """Copies in `folder`, stripped and pointed at each other; the licences of those that are others'."""
    own = {"libneupig.so.0": build / "libneupig.so.0"} | {name: build / name for name in PROGRAMS}
    needs: dict[str, pathlib.Path] = {}
    for file in own.values():
        needs |= needs_of(file)
    licences = licences_of(list(needs.values()))
    for name, file in (needs | own).items():
        copy = folder / name
        shutil.copy(file.resolve(), copy)
        copy.chmod(0o755)
        run("strip", "--strip-unneeded", str(copy))
        run("patchelf", "--force-rpath", "--set-rpath", "$ORIGIN", str(copy))
    return licences


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("build", type=pathlib.Path)
    parser.add_argument("-o", "--output", type=pathlib.Path, default=pathlib.Path.cwd())
    args = parser.parse_args()
    for tool in ("patchelf", "dpkg-query", "strip", "ldd"):
        if not shutil.which(tool):
            sys.exit(f"make_wheel.py: it takes {tool} (Debian: patchelf, dpkg, binutils, libc-bin)")
    inside = f"{backend.NAME}/lib"
    files = {f"{backend.NAME}/{p.name}": p.read_bytes() for p in backend._sources()}
    with tempfile.TemporaryDirectory() as folder:
        licences = gather(args.build, pathlib.Path(folder))
        copies = sorted(pathlib.Path(folder).iterdir())
        files |= {f"{inside}/{p.name}": p.read_bytes() for p in copies}
    page = args.build / "view" / "page.html"
    if page.exists():
        files[f"{inside}/view/page.html"] = page.read_bytes()
    files |= {f"{inside}/licences/{name}": text for name, text in sorted(licences.items())}
    files[f"{backend.DIST_INFO}/LICENSE"] = (pathlib.Path(__file__).resolve().parents[2] / "LICENSE").read_bytes()
    files[f"{backend.DIST_INFO}/entry_points.txt"] = b"[console_scripts]\nneupig = neupig._command:main\n"
    libc = "_".join(platform.libc_ver()[1].split(".")[:2])
    args.output.mkdir(parents=True, exist_ok=True)
    print(backend._write_wheel(str(args.output), files, f"py3-none-manylinux_{libc}_{platform.machine()}",
                               frozenset(f"{inside}/{name}" for name in PROGRAMS)))


if __name__ == "__main__":
    main()

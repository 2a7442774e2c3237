"""Build backend (PEP 517, PEP 660) with nothing but the standard library: pip needs no network to use it."""

import base64
import hashlib
import io
import pathlib
import tarfile
import tomllib
import zipfile

HERE = pathlib.Path(__file__).resolve().parent
PROJECT = tomllib.loads((HERE / "pyproject.toml").read_text(encoding="utf-8"))["project"]
NAME, VERSION = PROJECT["name"], PROJECT["version"]
DIST_INFO = f"{NAME}-{VERSION}.dist-info"


def _metadata() -> str:
    lines = [
        "Metadata-Version: 2.1",
        f"Name: {NAME}",
        f"Version: {VERSION}",
        f"Summary: {PROJECT['description']}",
        f"License: {PROJECT['license']['text']}",
        f"Requires-Python: {PROJECT['requires-python']}",
        *(f"Requires-Dist: {name}" for name in PROJECT["dependencies"]),
        "Description-Content-Type: text/markdown",
        "",
    ]
    return "\n".join(lines) + "\n" + (HERE / PROJECT["readme"]).read_text(encoding="utf-8")


def _sources() -> list[pathlib.Path]:
    return sorted(p for p in (HERE / NAME).iterdir() if p.suffix == ".py" or p.name == "py.typed")


def _write_wheel(folder: str, files: dict[str, bytes], tag: str = "py3-none-any", programs: frozenset[str] = frozenset()) -> str:
    """The same bytes for the same files: order and times are fixed.  programs: those of the files that can be run."""
    pure = "true" if tag.endswith("-any") else "false"
    files[f"{DIST_INFO}/METADATA"] = _metadata().encode()
    files[f"{DIST_INFO}/WHEEL"] = f"Wheel-Version: 1.0\nGenerator: {NAME}\nRoot-Is-Purelib: {pure}\nTag: {tag}\n".encode()
    record = ""
    for name, data in files.items():
        digest = base64.urlsafe_b64encode(hashlib.sha256(data).digest()).rstrip(b"=").decode()
        record += f"{name},sha256={digest},{len(data)}\n"
    files[f"{DIST_INFO}/RECORD"] = (record + f"{DIST_INFO}/RECORD,,\n").encode()
    name_of_wheel = f"{NAME}-{VERSION}-{tag}.whl"
    with zipfile.ZipFile(pathlib.Path(folder) / name_of_wheel, "w", zipfile.ZIP_DEFLATED) as wheel:
        for name, data in files.items():
            entry = zipfile.ZipInfo(name)
            entry.external_attr = (0o100755 if name in programs else 0o100644) << 16  # pip asks whether it is a file
            wheel.writestr(entry, data, zipfile.ZIP_DEFLATED)
    return name_of_wheel


def _source_tree() -> dict[str, bytes]:
    """Where the tree is whose build folder holds the library; nothing when this folder lies in none."""
    tree = HERE.parent.parent
    return {f"{NAME}/source_tree.txt": f"{tree}\n".encode()} if (tree / "pipeline" / "neupig.h").exists() else {}


def build_wheel(wheel_directory, config_settings=None, metadata_directory=None):
    return _write_wheel(wheel_directory, {f"{NAME}/{p.name}": p.read_bytes() for p in _sources()} | _source_tree())


def build_editable(wheel_directory, config_settings=None, metadata_directory=None):
    return _write_wheel(wheel_directory, {f"{NAME}.pth": f"{HERE}\n".encode()})


def build_sdist(sdist_directory, config_settings=None):
    base = f"{NAME}-{VERSION}"
    files = {f"{base}/PKG-INFO": _metadata().encode()}
    for path in [HERE / "pyproject.toml", HERE / "backend.py", HERE / PROJECT["readme"], *_sources()]:
        files[f"{base}/{path.relative_to(HERE)}"] = path.read_bytes()
    with tarfile.open(pathlib.Path(sdist_directory) / f"{base}.tar.gz", "w:gz", format=tarfile.PAX_FORMAT) as sdist:
        for name, data in files.items():
            entry = tarfile.TarInfo(name)
            entry.size = len(data)
            sdist.addfile(entry, io.BytesIO(data))
    return f"{base}.tar.gz"

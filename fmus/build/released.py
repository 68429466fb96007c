"""Compiled FMUs that come with the package, for platforms on which its release has stepped them.

One that does not belong to this source, is not what the release has written, or cannot be loaded here is
left alone: the builder compiles it then.
"""

import ctypes
import hashlib
import json
import zipfile
from collections.abc import Sequence
from pathlib import Path
from shutil import copyfile

from ..native.compilers import TARGETS, this_platform
from .finding import ROOT
from .platforms import Native

FOLDER = ROOT / "native" / "released"  # a folder for each platform in it
MANIFEST = "manifest.json"  # hash of the source of all of them, and SHA-256 of each


def release(fmus: Sequence[Path], source: str, folder: Path) -> None:
    """Write FMUs of this platform, which have been loaded and stepped, for a release.

    Args:
        fmus: their files.
        source: hash of the source that they were built from.
        folder: of the release, to be :data:`FOLDER`.
    """
    there = folder / this_platform()
    there.mkdir(parents=True)
    for fmu in fmus:
        copyfile(fmu, there / fmu.name)
    content = {"source": source, "fmus": {fmu.name: _sha256(fmu) for fmu in fmus}}
    (there / MANIFEST).write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")


def released(name: str, source: str, native: Native, work: Path) -> Path | None:
    """Copy of an FMU that came with the package; None if there is none that fits and loads.

    Args:
        name: of the component, as declared.
        source: hash of the present source.
        native: what the FMU is to hold.
        work: a scratch folder.
    """
    platform = this_platform()
    if native.targets != (platform,) or native.python:
        return None
    fmu = FOLDER / platform / f"{name}.fmu"
    try:
        manifest = json.loads(fmu.with_name(MANIFEST).read_text(encoding="utf-8"))
        if manifest["source"] != source or manifest["fmus"][fmu.name] != _sha256(fmu):
            return None
        copy = Path(copyfile(fmu, work / fmu.name))
        with zipfile.ZipFile(copy) as archive:
            library = archive.extract(f"binaries/{platform}/{name}{TARGETS[platform].suffix}", work)
        ctypes.CDLL(library)
    except (OSError, KeyError, ValueError):
        return None
    return copy


def _sha256(file: Path) -> str:
    return hashlib.sha256(file.read_bytes()).hexdigest()

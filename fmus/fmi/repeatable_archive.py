"""An FMU as an archive: the same files give the same bytes."""

import zipfile
from collections.abc import Mapping
from pathlib import Path


def write_archive(fmu: Path, files: Mapping[str, bytes]) -> Path:
    """Write files into an FMU, in the order of their names and without dates; returns its path."""
    with zipfile.ZipFile(fmu, "w") as archive:
        for name in sorted(files):
            info = zipfile.ZipInfo(name)  # of the earliest date that there is
            info.external_attr = 0o644 << 16
            archive.writestr(info, files[name], zipfile.ZIP_DEFLATED)
    return fmu

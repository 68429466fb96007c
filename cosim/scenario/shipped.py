"""The scenarios that come with the project, by name: ``ellipse``, ``eight``, ``setpoint``, ..."""

import os
from collections.abc import Iterable, Iterator
from pathlib import Path

from ..errors import InputError, nearest
from ..formats.namespaces import OSP_STRUCTURE
from ..formats.ssv import ParameterSet, read_parameters

# In a clone beside the packages, in an installation within this one (setup.py).
FOLDERS = (Path(__file__).parents[2] / "scenarios", Path(__file__).parents[1] / "shipped")


def shipped_folder() -> Path:
    """The folder of the shipped scenarios and parameter sets."""
    return next((folder for folder in reversed(FOLDERS) if folder.is_dir()), FOLDERS[0])


def shipped_names() -> list[str]:
    """The names of the shipped scenarios."""
    return sorted(path.stem for path in shipped_folder().glob("*.json"))


def find_parameters(sources: Iterable[str | Path]) -> Iterator[tuple[Path, ParameterSet]]:
    """Parameter sets with their files: paths, or bare names of shipped ones.

    Raises:
        InputError: there is no such set, or it cannot be read.
    """
    for source in sources:
        path = Path(source)
        if path.name == str(source) and not path.exists():
            shipped = shipped_folder() / f"{path.name.removesuffix('.ssv')}.ssv"
            near = [p.stem for p in shipped.parent.glob("*.ssv")]
            if not shipped.is_file():
                raise InputError(f"no such parameter set: '{path}'{nearest(path.stem, near)}")
            path = shipped
        yield path, read_parameters(path)


def find_scenario(source: str | Path, folder: Path = Path()) -> Path:
    """The file of a scenario: a path relative to a folder, or the bare name of a shipped one.

    A file of that name, or a folder that is a system, comes first; any other folder does not count.

    Raises:
        InputError: it is no name.
    """
    if not isinstance(source, (str, Path)):
        raise InputError(f"a scenario is a name, a file or a dict, not of type {type(source).__name__}")
    path = folder / source
    # Of a name that no file can have pathlib would raise.
    is_there = os.path.isfile(path) or os.path.isfile(path / OSP_STRUCTURE)
    if not is_there and path.name == str(source) and path.name in shipped_names():
        return shipped_folder() / f"{path.name}.json"
    return path

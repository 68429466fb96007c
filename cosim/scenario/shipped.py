"""The scenarios that come with the project, by name: ``ellipse``, ``eight``, ``setpoint``, ..."""

from pathlib import Path

from ..formats.namespaces import OSP_STRUCTURE

# In a clone beside the packages, in an installation within this one (setup.py).
FOLDERS = (Path(__file__).parents[2] / "scenarios", Path(__file__).parents[1] / "shipped")


def shipped_folder() -> Path:
    """The folder of the shipped scenarios and parameter sets."""
    return next((folder for folder in reversed(FOLDERS) if folder.is_dir()), FOLDERS[0])


def shipped_names() -> list[str]:
    """The names of the shipped scenarios."""
    return sorted(path.stem for path in shipped_folder().glob("*.json"))


def find_scenario(source: str | Path, folder: Path = Path()) -> Path:
    """The file of a scenario: a path relative to a folder, or the bare name of a shipped one.

    A file of that name, or a folder that is a system, comes first; any other folder does not count.
    """
    path = folder / source
    is_there = path.is_file() or (path / OSP_STRUCTURE).is_file()
    if not is_there and path.name == str(source) and path.name in shipped_names():
        return shipped_folder() / f"{path.name}.json"
    return path

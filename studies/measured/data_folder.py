"""Where the measured runs of the real ship are."""

from pathlib import Path

from cosim import InputError


def measured_files(data: Path) -> list[Path]:
    """The measured runs in a folder, or in its folder ``cse1``.

    Raises:
        InputError: there are none.
    """
    found = sorted(data.glob("*.mat")) or sorted((data / "cse1").glob("*.mat"))
    if not found:
        raise InputError(f"no measured runs (*.mat) in '{data}' or '{data / 'cse1'}'")
    return found

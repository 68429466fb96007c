"""Limits of a run as a user gives them: minutes, and a basin by its size or from a file."""

from pathlib import Path

from pydantic import BaseModel, ConfigDict, Field

from cosim import InputError
from cosim.scenario import read_model

from .designing import Limits
from .planned_motion import Basin


class Span(BaseModel):
    """A basin: lowest and highest north and east of its walls [m]."""

    model_config = ConfigDict(extra="forbid", allow_inf_nan=False)
    north: tuple[float, float] = Field(description="lowest and highest north [m]")
    east: tuple[float, float] = Field(description="lowest and highest east [m]")


def limits_of(minutes: float, basin: str | Path | tuple[float, float] | None) -> Limits:
    """The limits of a run.

    Args:
        minutes: length of the run.
        basin: length to the north and to the east [m], also as ``6x4``, or the path of a JSON file.

    Raises:
        InputError: a length that is not positive, or no such file.
    """
    if not 0.0 < minutes < 1e4:
        raise InputError(f"a run takes a positive number of minutes; got {minutes:g}")
    if basin is None:
        return Limits(60.0 * minutes)
    if isinstance(basin, tuple):
        sizes = [float(x) for x in basin]
    else:
        try:
            sizes = [float(x) for x in str(basin).lower().split("x")]
        except ValueError:
            return Limits(60.0 * minutes, Basin(*_basin_file(Path(basin))))
    if len(sizes) != 2 or not all(0.0 < x < 1e6 for x in sizes):
        raise InputError(f"a basin is two positive lengths [m] as in 6x4, or a JSON file; got '{basin}'")
    return Limits(60.0 * minutes, size=(sizes[0], sizes[1]))


def _basin_file(path: Path) -> tuple[tuple[float, float], tuple[float, float]]:
    what = "a basin (two lengths [m] to the north and to the east as in 6x4, or a JSON file)"
    span = read_model(path, Span, what, strict=False)
    for name, (low, high) in (("north", span.north), ("east", span.east)):
        if not low < high:
            raise InputError(f"'{path}': {name} must be the lowest, then the highest value [m]")
    return span.north, span.east

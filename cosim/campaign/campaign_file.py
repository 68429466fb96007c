"""The content of a campaign file, and its checks that need no FMU."""

from operator import itemgetter
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field, PositiveInt, field_validator, model_validator

from cybership.message_text import Location

from ..errors import InputError
from ..scenario.json_files import StrictModel, checked, json_content
from ..scenario.load import load_scenario
from ..scenario.schema import Scenario
from ..scenario.setting import place_of
from ..scenario.shipped import find_scenario
from ..trials.measures import EVERY

# Columns of the table that are no axes.
OUTCOME = ("status", "message", "wall_s", "hash")
TAKEN = (*(metric.name for metric in EVERY), *OUTCOME)
DISTRIBUTIONS = ("uniform", "normal", "log_uniform")
# Runs of a campaign; chosen: a grid with a slip in it is larger, and would fill the memory first.
MOST_RUNS = 1_000_000

Pair = tuple[float, float]


class CampaignAxis(StrictModel):
    """One quantity that differs from run to run: where it is set, and which values it takes."""

    set: str | Annotated[list[str], Field(min_length=1)] = Field(
        description="path of a value in the scenario, or several paths that get the same value"
    )
    values: Annotated[list[Any], Field(min_length=1)] | None = Field(
        None, description="values in their order"
    )
    labels: list[str] | None = Field(None, description="labels of the table, one for each of the values")
    uniform: Pair | None = Field(None, description="lowest and highest")
    normal: Pair | None = Field(None, description="mean and standard deviation")
    log_uniform: Pair | None = Field(
        None, description="lowest and highest value; the logarithm is uniform"
    )
    cross: bool = Field(
        False, description="under latin and sobol: combine every sample with each of the values"
    )

    @model_validator(mode="after")
    def _check(self) -> "CampaignAxis":
        kinds = ("values", *DISTRIBUTIONS)
        given = [kind for kind in kinds if getattr(self, kind) is not None]
        if len(given) != 1:
            raise ValueError(f"give one of {', '.join(kinds)}")
        for kind in ("uniform", "log_uniform"):
            pair = getattr(self, kind)
            if pair is not None and not pair[0] < pair[1]:
                raise ValueError(f"{kind} [{pair[0]:g}, {pair[1]:g}]: the lower value comes first")
        if self.log_uniform is not None and self.log_uniform[0] <= 0.0:
            raise ValueError(
                f"log_uniform [{self.log_uniform[0]:g}, ...]: the lower value must be above zero"
            )
        if self.normal is not None and self.normal[1] <= 0.0:
            raise ValueError(
                f"normal: the standard deviation must be above zero; got {self.normal[1]:g}"
            )
        if self.labels is not None and len(self.labels) != len(self.values or ()):
            raise ValueError("'labels' needs one label for each of the values")
        if self.labels is not None and len(set(self.labels)) != len(self.labels):
            raise ValueError("'labels' has a label twice")
        if self.cross and self.values is None:
            raise ValueError("'cross' needs 'values'")
        return self

    @property
    def distribution(self) -> str:
        """The name of the distribution from which it is drawn; empty where it has values."""
        return next((kind for kind in DISTRIBUTIONS if getattr(self, kind) is not None), "")

    @property
    def paths(self) -> list[str]:
        """Where it is set."""
        return [self.set] if isinstance(self.set, str) else self.set


class Latin(StrictModel):
    """A Latin hypercube sample: each axis is divided in as many strata as there are samples."""

    latin: PositiveInt = Field(le=MOST_RUNS, description="number of samples")


class Sobol(StrictModel):
    """A scrambled Sobol sequence."""

    sobol: PositiveInt = Field(le=MOST_RUNS, description="number of samples; a power of two is best")


class Campaign(StrictModel):
    """Many runs: a scenario, what differs between them, and how the values are combined."""

    scenario: str = Field(
        min_length=1,
        description="path, relative to the campaign file, or the name of a shipped scenario",
    )
    axes: dict[str, CampaignAxis] = Field(
        min_length=1, description="axes by the names of their columns in the table"
    )
    design: Literal["grid", "list"] | Latin | Sobol = Field(
        "grid", description="all combinations, the k-th value of each axis together, or a sample"
    )
    seed: Annotated[int, Field(ge=0)] = Field(0, description="seed of the samples and of their order")

    @field_validator("axes")
    @classmethod
    def _free_names(cls, axes: dict[str, CampaignAxis]) -> dict[str, CampaignAxis]:
        for name in axes:
            if name in TAKEN or not name.strip() or not name.isprintable():
                raise ValueError(
                    f"'{name}' cannot be an axis: the table already has a column of this name"
                )
        return axes

    @model_validator(mode="after")
    def _check_design(self) -> "Campaign":
        sampled = not isinstance(self.design, str)
        for name, axis in self.axes.items():
            if axis.distribution and not sampled:
                raise ValueError(
                    f"axes.{name}: {axis.distribution} is not possible in a {self.design}; give it "
                    'values, or "design": {"latin": 100}'
                )
            if axis.cross and not sampled:
                raise ValueError(
                    f"axes.{name}: cross is for latin and sobol; a grid has all combinations"
                )
        lengths = {name: len(axis.values or ()) for name, axis in self.axes.items()}
        if self.design == "list" and len(set(lengths.values())) > 1:
            stated = ", ".join(f"{name} has {count}" for name, count in lengths.items())
            raise ValueError(f"a list needs the same number of values in each axis: {stated}")
        if sampled and all(axis.cross for axis in self.axes.values()):
            raise ValueError("all axes are crossed, so no axis is left to sample")
        return self


class LoadedCampaign:
    """A campaign with the scenario that its runs vary.

    Args:
        source: path of the file, or the same content as a dict, as if it lay in the working directory.
        base: the scenario, in place of the one that the file names.

    Attributes:
        campaign: what the file says.
        base: the scenario.
        folder: to which paths in the campaign are relative.
        outer_first: axis and path of each value that axes set; a group before what is in it.

    Raises:
        InputError: no such file, an unknown key, a value that cannot be, or a path that the scenario
            does not have.
    """

    def __init__(self, source: str | Path | dict[str, Any], base: Scenario | None = None) -> None:
        self.folder = Path.cwd() if isinstance(source, dict) else Path(source).resolve().parent
        shown = "campaign" if isinstance(source, dict) else f"'{source}'"
        content = source if isinstance(source, dict) else json_content(Path(source), "a campaign")
        self.campaign = checked(Campaign, content, shown, _special)
        self.base = base or load_scenario(find_scenario(self.campaign.scenario, self.folder))
        dumped = self.base.model_dump(mode="json", by_alias=True, exclude_unset=True)
        taken: dict[tuple[str, ...], str] = {}
        depths: list[tuple[int, str, str]] = []
        for name, axis in self.campaign.axes.items():
            for path in axis.paths:
                try:
                    place = place_of(dumped, path)
                except InputError as error:
                    raise InputError(f"{shown}: axes.{name}.set: {error}") from None
                if place in taken:
                    raise InputError(
                        f"{shown}: axes {taken[place]} and {name} set the same value, {path}"
                    )
                taken[place] = name
                depths.append((len(place), name, path))
        self.outer_first = [(name, path) for _, name, path in sorted(depths, key=itemgetter(0))]


def _special(_: str, location: Location, __: object) -> str:
    return 'is "grid", "list", {"latin": N} or {"sobol": N}' if location[:1] == ("design",) else ""

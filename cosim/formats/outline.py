"""What annotations in model descriptions tell: the ship to draw, a trial, estimates of parameters."""

import math
from collections.abc import Mapping
from typing import Any, NamedTuple
from xml.etree.ElementTree import Element

SHIP = "Tool[@name='cybership']/Ship"  # among the vendor annotations
TRIAL = "Tool[@name='cybership']/Trial"
ESTIMATE = "Tool[@name='cybership']/Estimates/Estimate"
MOST_CORNERS = 1000


class AnnotatedOutline(NamedTuple):
    """A ship as it is drawn.

    Attributes:
        name: of the ship.
        length: between perpendiculars [m].
        corners: (forward, to starboard) [m, m] of the waterline, from the point that poses are of.
    """

    name: str
    length: float
    corners: tuple[tuple[float, float], ...]

    @classmethod
    def read(cls, stated: Mapping[str, Any]) -> "AnnotatedOutline | None":
        """An outline from the entries of JSON; None if these are of none."""
        try:
            corners = tuple((float(x), float(y)) for x, y in stated["corners"])
            made = cls(str(stated["name"]), float(stated["length"]), corners)
        except (KeyError, TypeError, ValueError):
            return None
        numbers = [made.length, *(number for corner in corners for number in corner)]
        usable = 3 <= len(corners) <= MOST_CORNERS and all(map(math.isfinite, numbers))
        return made if usable and made.length > 0.0 else None


def read_outline(annotations: Element | None) -> AnnotatedOutline | None:
    """The outline in the vendor annotations of an FMU; None where there is none."""
    ship = None if annotations is None else annotations.find(SHIP)
    if ship is None:
        return None
    corners = [corner.split(",") for corner in ship.get("outline", "").split()]
    return AnnotatedOutline.read({**ship.attrib, "corners": corners})


class CommandLimit(NamedTuple):
    """The lowest and the highest value of a command of an actuator, and its unit."""

    low: float
    high: float
    unit: str


class AnnotatedTrial(NamedTuple):
    """A manoeuvring trial.

    Attributes:
        kind: such as ``zigzag``.
        order: the signal of the order under trial, ``instance.variable``.
    """

    kind: str
    order: str


def read_trial(annotations: Element | None, instance: str) -> AnnotatedTrial | None:
    """The trial that an FMU conducts, by its output ``order``; None: it conducts none."""
    trial = None if annotations is None else annotations.find(TRIAL)
    return None if trial is None else AnnotatedTrial(trial.get("kind", ""), f"{instance}.order")


class AnnotatedEstimate(NamedTuple):
    """What a parameter is the first estimate of.

    Attributes:
        of: a parameter of the plant.
        change: whether it is of what is added to that one.
    """

    of: str
    change: bool


def read_estimates(annotations: Element | None) -> dict[str, AnnotatedEstimate]:
    """The parameters of an FMU that are estimates of a plant's, by name."""
    stated = [] if annotations is None else annotations.findall(ESTIMATE)
    return {
        e.get("parameter", ""): AnnotatedEstimate(e.get("of", ""), e.get("change") == "true")
        for e in stated
    }

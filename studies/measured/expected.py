"""Targets and expectations of the real ship, set before the study, and the result of each."""

from collections.abc import Sequence
from math import isfinite
from typing import NamedTuple

from diagnosis import Content

AXES = ("surge", "sway", "yaw")
BY_HAND, STEERED = "by hand", "dynamic positioning"
# Fall of the RMS model error on a run that was left out, and in which runs it counts.
TARGETS: dict[str, tuple[float, tuple[str, ...]]] = {
    "surge": (4.0, (STEERED,)),
    "sway": (7.0, (BY_HAND,)),
    "yaw": (2.5, (BY_HAND, STEERED)),
}
CURVE_WITHIN = 0.1  # N
SHAPES = ("thrust_curve", "curve_vsp_x(c)")
DELAY = (0.3, 0.5)  # s
CLEARLY = 0.1  # of what is left


class Fall(NamedTuple):
    """Of one axis of a run: left out of training, in training, and at most.

    Attributes:
        out: fall of the model error when the run is left out.
        seen: when it is among the training runs; NaN if that was not tried.
        most: at which only the measurement's noise is left.
        both, single: shares of what is left that the commands of the VSP would explain, by the sum of
            the two and by each.
    """

    out: float
    seen: float
    most: float
    both: float
    single: float


class Expectation(NamedTuple):
    """What was expected, and for each set of runs what came."""

    expected: str
    came: list[str]


def wanted(axis: str, kind: str) -> float | None:
    """The fall that an axis should reach in runs of a kind; None: none was set."""
    least, kinds = TARGETS[axis]
    return least if kind in kinds else None


def reason(fall: Fall, target: float) -> str:
    """Why a target was not reached, as far as the numbers tell."""
    if fall.most < target:
        return f"the measurement's noise alone allows {fall.most:.2g}× at most"
    if not isfinite(fall.seen):
        return "not known"
    if fall.seen >= target:
        text = (
            "the other runs do not suffice to learn this run; with this run in the training data: "
            f"{fall.seen:.2g}×"
        )
        return text + commanded(fall)
    text = f"not reached with this run in the training data either ({fall.seen:.2g}×)"
    return text + commanded(fall)


def commanded(fall: Fall) -> str:
    """Share of the rest that the commands of the VSP explain, in words; empty: hardly any."""
    if fall.single < CLEARLY:
        return ""
    text = f"; {100.0 * fall.single:.0f} % of the squared residual depend on the commands of single VSP"
    if fall.both < 0.5 * fall.single:
        text += ", for which the model has one common law"
    return text


def vsp_curve(found: Content) -> str:
    """The shape of the VSP's surge force."""
    came = [e.id for e in found.accepted if e.id in SHAPES]
    if came:
        return ", ".join(came)
    alike = [i for e in found.accepted for i in e.indistinguishable if i in SHAPES]
    return f"only as indistinguishable ({', '.join(dict.fromkeys(alike))})" if alike else "no"


def coefficients(found: Content, axis: str) -> str:
    """Damping coefficients of an axis: as effects, and as nominal ones that are likely wrong."""
    effects = [e.id for e in found.accepted if e.id.startswith(f"{axis}_")]
    suspects = [f"{s.name} = {s.value:.3g}" for s in found.suspect_coefficients if s.name[0] == axis]
    return ", ".join(effects + suspects) or "no"


def delay(found: Content) -> str:
    """A pure delay of the thrusters, and whether it is as long as expected."""
    for e in found.accepted:
        value = e.coefficients["delay"].value if e.id == "delay" else None
        if value is not None:
            within = DELAY[0] <= value <= DELAY[1]
            return f"{value:.3g} s" + ("" if within else ", not as expected")
    others = [e.id for e in found.accepted if e.id in ("lag", "clock_offset")]
    return f"no; {', '.join(others)} in its place" if others else "no"


def expectations(found: Sequence[Content]) -> list[Expectation]:
    """What was expected, and the result of each diagnosis."""
    return [
        Expectation("thrust_curve or curve_vsp_x(c)", [vsp_curve(d) for d in found]),
        Expectation("Y coefficients", [coefficients(d, "Y") for d in found]),
        Expectation("N coefficients", [coefficients(d, "N") for d in found]),
        Expectation("delay of 0.3 to 0.5 s", [delay(d) for d in found]),
    ]

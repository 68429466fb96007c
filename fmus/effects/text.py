"""What the sentences of all effects share: the finding, and how numbers read."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from math import atan2, degrees

from .effect import Effect

WRITTEN_OUT = 1e6  # 1, magnitude below which no digit is left out in favour of an exponent; chosen
SIDES = {"X": ("ahead", "astern"), "Y": ("to starboard", "to port"), "N": ("to starboard", "to port")}


@dataclass(frozen=True)
class Found:
    """An effect that was found.

    Attributes:
        effect: which.
        values: of its parameters: of coefficients additions to the nominal ones. One that is not given
            is as it is declared, which for a coefficient is 0.
        speeds: u, v, r that the ship reached [m/s, m/s, rad/s].
    """

    effect: Effect
    values: Mapping[str, float]
    speeds: tuple[float, float, float] = (0.1, 0.05, 0.1)

    def __getitem__(self, name: str) -> float:
        declared = {p.name: p.start for p in self.effect.parameters}
        return self.values.get(name, declared[name])


def number(x: float, digits: int = 3) -> str:
    """The size of a number; of 1 and more without an exponent, up to a million."""
    text = f"{abs(x):.{digits}g}"
    return f"{abs(x):.0f}" if "e" in text and 1.0 <= abs(x) < WRITTEN_OUT else text


def signed(x: float, digits: int = 3, plus: str = "") -> str:
    """A number as of :func:`number` with its sign; ``plus`` stands before one that is not negative."""
    return f"{'-' if x < 0.0 else plus}{number(x, digits)}"


def percent(x: float) -> str:
    """The size of a share."""
    return f"{100.0 * abs(x):.3g} %"


def towards(x: float, unit: str, axis: str) -> str:
    """A force or a way with its direction, such as ``0.3 N astern``."""
    return f"{number(x)} {unit} {SIDES[axis][x < 0.0]}"


def compass(north: float, east: float) -> str:
    """The direction of a vector, such as ``90°``."""
    return f"{degrees(atan2(east, north)) % 360.0:.0f}°"


def capital(text: str) -> str:
    """The text with a capital letter at its start."""
    return text[:1].upper() + text[1:]


def enumeration(parts: Sequence[str], joined: str = "and") -> str:
    """One or more parts of a sentence: a, b and c."""
    *most, last = parts
    return f"{', '.join(most)} {joined} {last}" if most else last


def lost(name: str, sentence: Callable[[str, str], str]) -> Callable[[Found], str]:
    """The sentence of a share that is lost, or gained where it is negative.

    Args:
        name: of the share.
        sentence: what is said of its size, and of less or more.
    """
    return lambda f: sentence(percent(f[name]), "less" if f[name] > 0.0 else "more")


def against_command(share: float, model: object) -> str:
    """What to check where all of a force seems lost, or more, which is beyond the end of a search."""
    return "more would be a force against the command: check its sign in the log" if share > 0.0 else ""


def offset(f: Found, name: str) -> str:
    """A place on the ship, by ``name_dx`` and ``name_dy`` [m]; one of them where the other is 0."""
    ways = [(f[f"{name}_dx"], "X"), (f[f"{name}_dy"], "Y")]
    return " and ".join(
        towards(way, "m", axis) if abs(way) >= 1.0 else towards(100.0 * way, "cm", axis)
        for way, axis in [each for each in ways if each[0]] or ways
    )


def peak(f: Found) -> tuple[float, float]:
    """Where a curve is furthest from zero, as a share of its way from the first node, and its value."""
    nodes = [f[name] for name in f.effect.coefficients]
    k = max(range(len(nodes)), key=lambda i: abs(nodes[i]))
    return k / (len(nodes) - 1), nodes[k]


def reach(f: Found) -> float:
    """The range of a curve's nodes."""
    (setting,) = (p for p in f.effect.parameters if p.name in f.effect.settings)
    return f[setting.name]

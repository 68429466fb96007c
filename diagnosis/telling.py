"""What the phrases of all effects share: what is told, how numbers read, and which effect has which."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from math import atan2, degrees

from fmus.effects import Effect

Words = Callable[["Told"], str]
REGISTRY: dict[str, Words] = {}
SIDES = {"X": ("ahead", "astern"), "Y": ("to starboard", "to port"), "N": ("to starboard", "to port")}


@dataclass(frozen=True)
class Told:
    """What is to be told.

    Attributes:
        effect: that was found.
        values: its parameters, additions to the nominal ones.
        speeds: u, v, r that the ship reached [m/s, m/s, rad/s].
    """

    effect: Effect
    values: Mapping[str, float]
    speeds: tuple[float, float, float] = (0.1, 0.05, 0.1)

    def __getitem__(self, name: str) -> float:
        return self.values.get(name, 0.0)


def says(*ids: str) -> Callable[[Words], Words]:
    """Decorator: the function puts the effects with these ids into words."""

    def register(words: Words) -> Words:
        REGISTRY.update(dict.fromkeys(ids, words))
        return words

    return register


def number(x: float) -> str:
    return f"{abs(x):.3g}"


def percent(x: float) -> str:
    return f"{100.0 * abs(x):.3g} %"


def towards(x: float, unit: str, axis: str) -> str:
    """A force or a way with its direction, such as ``0.3 N astern``."""
    return f"{number(x)} {unit} {SIDES[axis][x < 0.0]}"


def compass(north: float, east: float) -> str:
    return f"{degrees(atan2(east, north)) % 360.0:.0f}°"


def capital(text: str) -> str:
    return text[:1].upper() + text[1:]

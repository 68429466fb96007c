"""A finding in words: a sentence, an equation, and what to run to discriminate effects."""

from collections.abc import Mapping, Sequence

import numpy as np

from cybership.message_text import counted
from fmus.effects import Effect, EffectSet
from fmus.effects.text import Found, enumeration, signed

from ..execution.short_text import SHOWN
from ..predictors.ship_model import parameter_and_run


def sentence(found: Found) -> str:
    """The finding in one sentence: the effect's own, else its description."""
    own = found.effect.wording.sentence
    if own is not None:
        return own(found)
    return f"The ship has an effect that the model lacks: {found.effect.description.rstrip('.')}."


def unit(effect: Effect, name: str) -> str:
    """The unit of a parameter of an effect, or of its value in one run."""
    return next(p.unit for p in effect.parameters if p.name == parameter_and_run(name)[0])


def equation(
    effect: Effect, values: Mapping[str, float], ci95: Mapping[str, tuple[float, float]]
) -> str:
    """The effect's formula, and its coefficients with units and intervals."""
    formula = effect.formula or effect.id
    shown = [name for name in values if values[name] or name in ci95]
    if len(shown) > 2 * SHOWN:
        nodes = ", ".join(signed(values[name], 2) for name in shown)
        return f"{formula}; {shown[0]} ... {shown[-1]} = {nodes}{_behind(unit(effect, shown[0]))}"
    symbols = [s.strip() for s in effect.symbol.split(",")]
    names = symbols if len(symbols) == len(effect.coefficients) else effect.coefficients
    called = dict(zip(effect.coefficients, names, strict=True))
    parts = []
    for n in shown:
        parameter, run = parameter_and_run(n)
        symbol = called.get(parameter, parameter) + (run and f" in {run}")
        parts.append(_coefficient(symbol, values[n], unit(effect, n), ci95.get(n)))
    return "; ".join([formula, *parts])


def _coefficient(symbol: str, value: float, unit: str, interval: tuple[float, float] | None) -> str:
    """Such as ``δ = 0.3 m (0.29 to 0.31)``."""
    digits = 3 if interval is None else _digits(*interval)
    text = f"{symbol} = {signed(value, digits)}{_behind(unit)}"
    return text if interval is None else f"{text} ({' to '.join(signed(x, digits) for x in interval)})"


def _behind(unit: str) -> str:
    """A unit behind a number; nothing for ``1``."""
    return f" {unit}" if unit != "1" else ""


def _digits(low: float, high: float) -> int:
    """Significant digits, three or more, in which the ends of an interval differ in two places."""
    size, width = max(abs(low), abs(high)), high - low
    if not (0.0 < width < np.inf and np.isfinite(size)):
        return 3
    return int(np.clip(np.ceil(np.log10(size / width)) + 2.0, 3.0, 9.0))


def discriminating_run(one: Effect, other: Effect) -> str:
    """What to run so that two effects can be discriminated.

    Either effect may know, or else the family of either; else both are excited.
    """
    a, b = one.wording, other.wording
    excite = "run " + "; and ".join(dict.fromkeys((a.family.excite, b.family.excite)))
    return (
        a.apart.get(other.id)
        or b.apart.get(one.id)
        or a.family.apart.get(b.family.name)
        or b.family.apart.get(a.family.name)
        or excite
    )


def advice(name: str, alike: Sequence[str], effects: EffectSet) -> str:
    """What to run next, for an effect and those that the data cannot discriminate from it; else empty.

    Args:
        name: id of the effect.
        alike: ids of the others, the most likely first; the advice is for the first few.
        effects: of the ship.
    """
    texts: dict[str, list[str]] = {}
    for other in alike[:SHOWN]:
        texts.setdefault(discriminating_run(effects[name], effects[other]), []).append(other)
    parts = [f"To discriminate {name} from {listed(ids)}: {text}." for text, ids in texts.items()]
    if len(alike) > SHOWN:
        parts.append(
            "The data do not suffice to discriminate so many candidates: vary speed, turn and "
            "drift more."
        )
    return " ".join(parts)


def listed(names: Sequence[str], joined: str = "or") -> str:
    """Names in a row: a, b or c; of many the first few, and how many more."""
    hidden = len(names) - SHOWN
    more = [counted(hidden, "other")] if hidden > 0 else []
    return enumeration([*names[:SHOWN], *more], joined)


def separation_note(name: str, alike: Sequence[str]) -> str:
    """Which effects these data cannot discriminate from one; empty if none."""
    return f"These data cannot discriminate {name} from {listed(alike)}." if alike else ""

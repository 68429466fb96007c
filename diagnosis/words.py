"""A finding in one sentence that a captain understands, and as an equation with numbers and units."""

from collections.abc import Mapping

from fmus.effects import Effect

from .phrases import REGISTRY, Told

NODES = 8  # more coefficients than that are a curve


def sentence(told: Told) -> str:
    """The finding in one sentence; that of a user's effect is what it says of itself."""
    return REGISTRY.get(told.effect.id, _described)(told)


def _described(t: Told) -> str:
    return f"The ship has an effect that the model lacks: {t.effect.description.rstrip('.')}."


def unit(effect: Effect, name: str) -> str:
    """The unit of a parameter; clock_offset is the parameter of no FMU."""
    return next((p.unit for p in effect.parameters if p.name == name), "s")


def equation(
    effect: Effect, values: Mapping[str, float], ci95: Mapping[str, tuple[float, float]]
) -> str:
    """The effect's formula, and its coefficients with units and intervals."""
    formula = effect.formula or effect.id
    shown = [name for name in values if values[name] or name in ci95]
    if len(shown) > NODES:
        nodes = ", ".join(f"{values[name]:.2g}" for name in shown)
        return f"{formula}; {shown[0]} ... {shown[-1]} = {nodes} {unit(effect, shown[0])}"
    symbols = [s.strip() for s in effect.symbol.split(",")]
    names = symbols if len(symbols) == len(effect.coefficients) else effect.coefficients
    called = dict(zip(effect.coefficients, names, strict=True))
    parts = [_coefficient(called.get(n, n), values[n], unit(effect, n), ci95.get(n)) for n in shown]
    return "; ".join([formula, *parts])


def _coefficient(symbol: str, value: float, unit: str, interval: tuple[float, float] | None) -> str:
    """Such as ``δ = 0.3 m (0.29 to 0.31)``."""
    text = f"{symbol} = {value:.3g}" + (f" {unit}" if unit != "1" else "")
    return text if interval is None else f"{text} ({interval[0]:.3g} to {interval[1]:.3g})"

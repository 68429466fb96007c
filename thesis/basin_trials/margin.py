"""How much delay the loop of backstepping bears with the gains of the thesis."""

from math import atan2, pi

from scipy.optimize import brentq

from fmus.hull import Inertia, mass_matrix

from .trials import HARD, SOFT

# Gains, and the factor on them.
SETTINGS = {"Table 5.1": (SOFT, 1.0), "Table 6.4": (HARD, 1.0), "twice Table 6.4": (HARD, 2.0)}
FILTER = 0.12  # s; time constant of the lab's derivative filter, a = 0.08 at 100 Hz


def margin(m: float, K_p: float, K_d: float) -> tuple[float, float]:
    """Delay margin [s] and crossover [Hz] of one axis alone, with the lab's filter in the loop.

    tau = -(1 + K_d K_p) z1 - (K_d + m K_p) z1_dot on a mass m.
    """

    def gain(w: float) -> complex:
        force = 1.0 + K_d * K_p + 1j * w * (K_d + m * K_p)
        return force / (1.0 + 1j * w * FILTER) / (m * w * w)

    crossover: float = brentq(lambda w: abs(gain(w)) - 1.0, 1e-3, 1e3)  # pyright: ignore
    at = gain(crossover)
    return atan2(at.imag, at.real) / crossover, crossover / (2.0 * pi)


def margins() -> dict[str, tuple[float, float]]:
    """Gains -> the smallest delay margin [s] among the axes, and its crossover [Hz]."""
    masses = [row[k] for k, row in enumerate(mass_matrix(Inertia()))]
    found = {}
    for name, (k, factor) in SETTINGS.items():
        values = [factor * x for x in k.values()]
        found[name] = min(margin(*axis) for axis in zip(masses, values[:3], values[3:], strict=True))
    return found

"""The form, sign and direction of each hidden effect, drawn; its size is a scale that stays free."""

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from fmus.ship import ship

from .foreign_physics import MIDDLE_X, MIDDLE_Y, REACH
from .simulated_runs import FINE, STEP
from .truth import Motion

EFFECTS = ship().effects

Scaled = Callable[[float], dict[str, float]]
NODES = np.linspace(-1.0, 1.0, 21)


def form(effect: str, rng: np.random.Generator, pilot: Sequence[Motion]) -> Scaled:
    """An effect's parameters as a function of a scale: its form and sign are drawn here."""
    one = {
        "drag |u|^1.5": "drag_1_5",
        "bow exp(-(u/u0)^2)": "bow_exp",
        "deadband": "deadband",
        "lag": "lag",
        "bow_speed_loss": "bow_speed_loss",
        "mass": "mass",
        "added_mass_X": "added_mass_X",
        "added_mass_Y": "added_mass_Y",
        "added_mass_N": "added_mass_N",
    }
    if effect in one:
        return lambda s: {one[effect]: s}
    if effect.startswith("loss_"):
        return lambda s: {effect: min(s, 0.9)}
    if effect in FORMS:
        return FORMS[effect](rng, pilot)
    sign = float(rng.choice([-1.0, 1.0]))
    names = EFFECTS[effect].coefficients
    if len(names) == 1:
        return lambda s: {names[0]: sign * s}
    if effect in CURVES:
        return _shape(effect, rng, pilot)
    turn = rng.uniform(0.0, 2.0 * np.pi)
    return lambda s: {names[0]: s * float(np.cos(turn)), names[1]: s * float(np.sin(turn))}


# What a free curve is over, and whether it is over both signs.
CURVES: dict[str, tuple[Callable[[Motion], np.ndarray], bool]] = {
    "curve_X(u)": (lambda m: m.nu[:, 0], True),
    "curve_vsp_x(c)": (lambda m: m.commanded[:, 0], True),
    "curve_vsp_y(c)": (lambda m: m.commanded[:, 1], True),
    "curve_bow(|u|)": (lambda m: np.abs(m.nu[:, 0]), False),
}


def _shape(effect: str, rng: np.random.Generator, pilot: Sequence[Motion]) -> Scaled:
    """Two bumps of opposite sign within what the runs cover: no polynomial, no dead band."""
    over, both = CURVES[effect]
    e = EFFECTS[effect]
    reach = e.parameters[-1].start
    covered = np.concatenate([over(m) for m in pilot])
    nodes = reach * (NODES if both else 0.5 * (NODES + 1.0))
    spacing = nodes[1] - nodes[0]
    places = np.quantile(covered, [rng.uniform(0.1, 0.4), rng.uniform(0.6, 0.9)])
    sign = float(rng.choice([-1.0, 1.0]))
    bumps = [np.exp(-0.5 * ((nodes - place) / spacing) ** 2) for place in places]
    values = sign * (bumps[0] - float(rng.uniform(0.5, 1.0)) * bumps[1])
    return lambda s: {n: s * float(v) for n, v in zip(e.coefficients, values, strict=True)}


def _delay(name: str) -> Callable[..., Scaled]:
    return lambda rng, pilot: lambda s: {name: max(1, round(min(s, 1.0) / STEP)) * STEP}


def _off_grid(rng: np.random.Generator, pilot: Sequence[Motion]) -> Scaled:
    part = FINE * int(rng.integers(1, round(STEP / FINE)))
    return lambda s: {"delay": round(min(s, 1.0) / STEP) * STEP + part}


def _thrust_curve(rng: np.random.Generator, pilot: Sequence[Motion]) -> Scaled:
    side, other = rng.uniform(0.3, 1.0), rng.uniform(-1.0, 0.3)
    ahead, astern = (side, other) if rng.random() < 0.5 else (other, side)
    band = float(rng.uniform(0.0, 0.2))
    return lambda s: {
        "thrust_curve_ahead": float(np.clip(-s * ahead, -1.0, 1.0)),
        "thrust_curve_astern": float(np.clip(-s * astern, -1.0, 1.0)),
        "thrust_curve_deadband": min(s * band, 0.8),
    }


def _saturation(rng: np.random.Generator, pilot: Sequence[Motion]) -> Scaled:
    """The VSP, the bow thruster, or both, limited to a part of their largest command."""
    most = np.max([np.abs(m.commanded).max(axis=0) for m in pilot], axis=0)
    full = {"saturation_vsp": 1.165 * float(max(most[:2])), "saturation_bow": 2.629 * float(most[2])}
    names = list(full)[: rng.integers(1, 3)] if rng.random() < 0.5 else list(full)[1:]
    return lambda s: {name: full[name] / (1.0 + s) for name in names}


def _bias(rng: np.random.Generator, pilot: Sequence[Motion]) -> Scaled:
    tau = np.sqrt(np.mean([np.mean(m.tau**2, axis=0) for m in pilot], axis=0))
    parts = tau * rng.uniform(0.2, 1.0, 3) * rng.choice([-1.0, 1.0], 3)
    return lambda s: {f"body_bias_{a}": s * float(x) for a, x in zip("XYN", parts, strict=True)}


def _waves(rng: np.random.Generator, pilot: Sequence[Motion]) -> Scaled:
    way, peak = float(rng.uniform(-np.pi, np.pi)), float(rng.uniform(2.5, 6.0))
    return lambda s: {"wave_force": s, "wave_direction": way, "wave_peak": peak}


def _gusts(rng: np.random.Generator, pilot: Sequence[Motion]) -> Scaled:
    way, phase = float(rng.uniform(-np.pi, np.pi)), float(rng.uniform(0.0, 6.0))
    return lambda s: {"gust_force": s, "gust_direction": way, "gust_phase": phase}


def _bank(rng: np.random.Generator, pilot: Sequence[Motion]) -> Scaled:
    sign, width = float(rng.choice([-1.0, 1.0])), float(rng.uniform(0.3, 0.7))
    arm = float(rng.uniform(-0.4, -0.2))
    return lambda s: {"bank_force": sign * s, "bank_width": width, "bank_arm": arm}


def _shallow(rng: np.random.Generator, pilot: Sequence[Motion]) -> Scaled:
    edge = MIDDLE_X + float(rng.uniform(-0.4, 0.4))
    return lambda s: {"shallow_damping": s, "shallow_edge": edge}


def _tether(rng: np.random.Generator, pilot: Sequence[Motion]) -> Scaled:
    """Anchored outside of the paths, taut for a third to two thirds of the time."""
    turn = float(rng.uniform(0.0, 2.0 * np.pi))
    north, east = MIDDLE_X + 2.0 * REACH * np.cos(turn), MIDDLE_Y + 2.0 * REACH * np.sin(turn)
    distance = np.concatenate([np.hypot(m.eta[:, 0] - north, m.eta[:, 1] - east) for m in pilot])
    slack = float(np.quantile(distance, rng.uniform(0.33, 0.67)))
    given = {"tether_north": float(north), "tether_east": float(east), "tether_slack": slack}
    return lambda s: {"tether_stiffness": s, **given}


def _camera(rng: np.random.Generator, pilot: Sequence[Motion]) -> Scaled:
    length = float(rng.uniform(1.2, 2.0))
    return lambda s: {"distortion": min(0.1 * s, 0.1), "distortion_length": length}


FORMS: Mapping[str, Callable[..., Scaled]] = {
    "delay": _delay("delay"),
    "clock_offset": _delay("clock_offset"),
    "delay off the grid": _off_grid,
    "thrust_curve": _thrust_curve,
    "saturation": _saturation,
    "body_bias": _bias,
    "waves": _waves,
    "slow gusts": _gusts,
    "bank": _bank,
    "shallow water": _shallow,
    "tether": _tether,
    "bias by place": _camera,
}

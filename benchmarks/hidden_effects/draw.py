"""What is hidden, and how much of it: sizes log-uniform, 5 to 40 % of the force on its axis.

The size of an effect is the RMS of the force that it adds over the RMS of the force that the thrusters
give, on the axis where that is most, over the training runs. It is set by the motion of a ship without
any effect: with the effect the controller follows the same path.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from fmus.effects import EACH_VSP, STANDARD

from .simulated_runs import FINE, STEP, STOP
from .truth import NAMES, Motion, Values, force, over, windows

SMALLEST, LARGEST = 0.05, 0.4
NODES = np.linspace(-1.0, 1.0, 21)
# Ids of hidden effects whose form the diagnosis does not have, and the ids that come nearest.
FOREIGN: dict[str, tuple[str, ...]] = {
    "drag |u|^1.5": ("X_u", "X_|u|u", "curve_X(u)"),
    "bow exp(-(u/u0)^2)": ("bow_speed_loss", "curve_bow(|u|)"),
    "delay off the grid": ("delay",),
}
# The runs have one set of commands: what acts on one of the two propellers is no candidate there.
SINGLE = [*(e.id for e in STANDARD.values() if EACH_VSP not in e.needs), *FOREIGN]
OUT, SHORTEST = 0.2, 2.0  # share of the time that an outage takes, and its shortest interval [s]
Scaled = Callable[[float], dict[str, float]]


@dataclass(frozen=True)
class Draw:
    """An effect of a certain size.

    Attributes:
        effect: its id.
        values: its parameters.
        size: share of the force on its axis.
    """

    effect: str
    values: Values
    size: float

    @property
    def right(self) -> tuple[str, ...]:
        """The ids that are a right answer."""
        return FOREIGN.get(self.effect, (self.effect,))

    @property
    def measured(self) -> dict[str, float]:
        """Its parameters that are of the measurement."""
        names = ("marker_offset_dx", "marker_offset_dy", "heading_offset", "clock_offset")
        return {name: value for name, value in self.values.items() if name in names}


def draw(effect: str, rng: np.random.Generator, pilot: Sequence[Motion], less: float = 1.0) -> Draw:
    """An effect with its form, sign and size drawn.

    Args:
        effect: id.
        rng: of the draw.
        pilot: runs of a ship without it.
        less: factor on the size drawn.
    """
    scaled = form(effect, rng, pilot)
    size = less * float(np.exp(rng.uniform(np.log(SMALLEST), np.log(LARGEST))))
    if effect == "bow_failure":  # its time is drawn, not its size
        values = {"bow_failure_time": float(rng.uniform(0.25, 0.75)) * STOP}
    elif effect in STANDARD and STANDARD[effect].search.intervals:
        values = outage(effect, rng)
    else:
        values = scaled(_solve(lambda s: share(pilot, effect, scaled(s)), size))
    return Draw(effect, values, share(pilot, effect, values))


def outage(effect: str, rng: np.random.Generator) -> dict[str, float]:
    """Three to eight intervals that take a share of the time, one in each equal part of it."""
    names = STANDARD[effect].search.intervals
    count = int(rng.integers(3, len(names) + 1))
    room = STOP / count
    lasts = np.maximum(SHORTEST, OUT * room * rng.uniform(0.5, 1.5, count))
    starts = room * np.arange(count) + rng.uniform(0.1, 0.5, count) * room
    spans = zip(names, starts.tolist(), lasts.tolist(), strict=False)
    return {name: t for (a, b), start, last in spans for name, t in ((a, start), (b, start + last))}


def share(pilot: Sequence[Motion], effect: str, values: Values) -> float:
    """RMS of the added force over that of the thrusters, on the axis where that is most.

    Both are averaged over windows of 3 s, but for waves, which would vanish. The thrusters must give the
    force that an effect on the hull takes, too.
    """
    if effect == "waves":
        added, tau = (
            np.concatenate(x) for x in zip(*[(force(m, values), m.tau) for m in pilot], strict=True)
        )
    else:
        added = added_force(pilot, effect, values)
        tau = np.concatenate([windows(m.tau) for m in pilot])
    if not set(values) <= NAMES["thrusters"] and effect not in FOREIGN:
        tau = tau - added
    return float(np.max(np.sqrt((added**2).mean(axis=0) / (tau**2).mean(axis=0))))


def added_force(pilot: Sequence[Motion], effect: str, values: Values) -> np.ndarray:
    """Windows (K, 3) of the force of an effect, those of foreign form included."""
    if effect not in LAWS:
        return over(pilot, values)
    return np.concatenate([windows(LAWS[effect](m, *values.values())) for m in pilot])


def drag(m: Motion, at_one: float) -> np.ndarray:
    """Force (n, 3) of a drag by |u|^1.5 that is ``at_one`` [N] at 1 m/s."""
    u = m.nu[:, 0]
    X = -at_one * u * np.sqrt(np.abs(u))
    return np.column_stack([X, 0.0 * X, 0.0 * X])


def fading(m: Motion, inverse: float) -> np.ndarray:
    """Force (n, 3) that is lost of a bow thruster as effective as exp(-(inverse u)^2)."""
    kept = np.exp(-((inverse * m.nu[:, 0]) ** 2))
    commanded = m.commanded * np.column_stack([np.ones_like(kept), np.ones_like(kept), kept])
    return Motion(m.time, m.eta, m.nu, m.nu_dot, commanded).tau - m.tau


LAWS = {"drag |u|^1.5": drag, "bow exp(-(u/u0)^2)": fading}


def _solve(size: Callable[[float], float], wanted: float) -> float:
    """The least scale that gives a size, or the one that comes nearest."""
    scales = np.geomspace(1e-3, 1e3, 31)
    low = high = scales[0]
    for high in scales:
        if size(high) >= wanted:
            break
        low = high
    for _ in range(12):
        middle = float(np.sqrt(low * high))
        low, high = (low, middle) if size(middle) >= wanted else (middle, high)
    return float(high)


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
    names = STANDARD[effect].coefficients
    if len(names) == 1:
        return lambda s: {names[0]: sign * s}
    if effect in REACH:
        return _shape(effect, rng, pilot)
    turn = rng.uniform(0.0, 2.0 * np.pi)
    return lambda s: {names[0]: s * float(np.cos(turn)), names[1]: s * float(np.sin(turn))}


# What a free curve is over, and whether it is over both signs.
REACH: dict[str, tuple[Callable[[Motion], np.ndarray], bool]] = {
    "curve_X(u)": (lambda m: m.nu[:, 0], True),
    "curve_vsp_x(c)": (lambda m: m.commanded[:, 0], True),
    "curve_vsp_y(c)": (lambda m: m.commanded[:, 1], True),
    "curve_bow(|u|)": (lambda m: np.abs(m.nu[:, 0]), False),
}


def _shape(effect: str, rng: np.random.Generator, pilot: Sequence[Motion]) -> Scaled:
    """Two bumps of opposite sign within what the runs cover: no polynomial, no dead band."""
    over, both = REACH[effect]
    e = STANDARD[effect]
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


FORMS: Mapping[str, Callable[..., Scaled]] = {
    "delay": _delay("delay"),
    "clock_offset": _delay("clock_offset"),
    "delay off the grid": _off_grid,
    "thrust_curve": _thrust_curve,
    "saturation": _saturation,
    "body_bias": _bias,
    "waves": _waves,
}

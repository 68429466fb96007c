"""Observers run open loop over a log: what each would have estimated from the same measurements."""

import importlib
from collections.abc import Mapping, Sequence

import numpy as np

from fmus.declare import Component, packer, variables
from fmus.observer.screen import Inputs
from fmus.signals import Force, Measurement

Log = Mapping[str, np.ndarray]

OBSERVERS = ("df", "mdf", "nonlinear", "luenberger", "kalman")
SIGNALS = ("u", "v", "r", "u_dot", "v_dot", "r_dot")
UNITS = dict(zip(SIGNALS, ("m/s", "m/s", "rad/s", "m/s2", "m/s2", "rad/s2"), strict=True))
INPUTS = ("x_m", "y_m", "psi_m", "tau_X", "tau_Y", "tau_N")
# What a scenario must log.
LOGGED = [f"observer.{name}" for name in INPUTS] + [f"vessel.{name}" for name in SIGNALS]
SETTLED = 10.0  # s; before, an observer is still finding the ship
AFTER = 1.0  # s after an upset in which its consequences are looked for
ABSURD = 10.0  # m/s, rad/s, m/s2, rad/s2; no estimate, as NaN is none
LONGEST_LAG = 3.0  # s, up to which a lag is looked for; chosen: twice K_1/K_2 of the slowest observer
# No pose can be said to be frozen before it has been the same for this long [s].
FREEZE = 0.05


def observer(name: str) -> Component:
    """The observer's component: ``kalman`` is ``fmus/observer/kalman.py``."""
    return importlib.import_module(f"fmus.observer.{name}").COMPONENT


def parameters(component: Component, values: Mapping[str, float]) -> object:
    """Start values of the parameters, but for those given that the component has."""
    named = variables(component.params)
    return packer(component.params)([values.get(v.name, v.start) for v in named])


def replay(component: Component, log: Log, **values: float) -> dict[str, np.ndarray]:
    """What an observer estimates from the observer's inputs in a log.

    Args:
        component: observer.
        log: columns ``time`` [s] and ``observer.`` x_m, y_m, psi_m, tau_X, tau_Y, tau_N.
        values: parameters that differ from their start; those it does not have are passed over.

    Returns:
        Each output by name (``u_hat``, ...), and for each of SIGNALS the estimate without ``_hat``.
    """
    p = parameters(component, values)
    h = float(np.median(np.diff(log["time"])))
    rows = np.column_stack([log[f"observer.{name}"] for name in INPUTS]).tolist()
    first = Inputs(Measurement(*rows[0][:3]), Force(*rows[0][3:]))
    state, estimate = component.step(component.init(first, p), first, p, 0.0)
    estimates = [estimate]
    for x, y, psi, X, Y, N in rows[1:]:
        i = Inputs(Measurement(x, y, psi), Force(X, Y, N))
        state, estimate = component.step(state, i, p, h)
        estimates.append(estimate)
    columns = np.array(estimates).T
    found = dict(zip(component.outputs._fields, columns, strict=True))
    return found | {name: found[f"{name}_hat"] for name in SIGNALS}


def rms(values: np.ndarray) -> float:
    """Root of the mean square; infinite where an observer has run away."""
    if not values.size:
        return float("nan")
    with np.errstate(over="ignore"):
        found = float(np.sqrt(np.mean(np.square(values))))
    return found if np.isfinite(found) else float("inf")


def errors(log: Log, estimate: Log) -> dict[str, float]:
    """RMS error of each signal against the true state, after the observer has settled."""
    settled = log["time"] >= SETTLED
    return {name: rms((estimate[name] - log[f"vessel.{name}"])[settled]) for name in SIGNALS}


def lag(log: Log, estimate: Log, name: str) -> float:
    """Time [s] by which the truth, delayed, comes closest to an estimate; NaN if that is the longest."""
    h = float(np.median(np.diff(log["time"])))
    settled = log["time"] >= SETTLED
    true, found = log[f"vessel.{name}"][settled], estimate[name][settled]
    shifts = range(min(round(LONGEST_LAG / h), len(true) // 2))
    cost = [rms(found[k:] - true[: len(true) - k]) for k in shifts]
    least = int(np.argmin(cost))
    return least * h if least < len(cost) - 1 else float("nan")


def roughness(log: Log, estimate: Log, name: str) -> float:
    """Standard deviation of what an estimate does faster than a quarter of a second: its noise."""
    from scipy.signal import savgol_filter

    h = float(np.median(np.diff(log["time"])))
    values = estimate[name][log["time"] >= SETTLED]
    window = 2 * max(2, round(0.125 / h)) + 1
    if not np.isfinite(values).all():
        return float("nan")
    with np.errstate(over="ignore", invalid="ignore"):
        return float(np.std(values - savgol_filter(values, window, 2)))


def freezes(log: Log, shortest: float = FREEZE) -> list[tuple[int, int]]:
    """First row of each freeze and the row after it, where all channels repeat to the bit."""
    pose = np.column_stack([log[f"observer.{name}"] for name in INPUTS[:3]])
    same = np.concatenate([[False], (np.diff(pose, axis=0) == 0.0).all(axis=1), [False]])
    change = np.flatnonzero(np.diff(same))
    h = float(np.median(np.diff(log["time"])))
    return [
        (int(a) + 1, int(b) + 1)
        for a, b in zip(change[::2], change[1::2], strict=True)
        if (b - a) * h >= shortest and (a + 1) * h >= SETTLED
    ]


def wraps(log: Log) -> list[int]:
    """Rows in which the measured heading has jumped by about a turn."""
    rows = np.flatnonzero(np.abs(np.diff(log["observer.psi_m"])) > np.pi) + 1
    return [int(row) for row in rows if log["time"][row] >= SETTLED]


def peak_after(log: Log, estimate: Log, rows: Sequence[int], name: str) -> float:
    """Largest error within a second after any of these rows."""
    h = float(np.median(np.diff(log["time"])))
    error = np.nan_to_num(np.abs(estimate[name] - log[f"vessel.{name}"]), nan=np.inf)
    parts = [error[row : row + round(AFTER / h)] for row in rows]
    return float(max((part.max() for part in parts if part.size), default=float("nan")))


def held(log: Log, estimate: Log, moving: float = 0.02) -> float:
    """Share of the surge velocity that is left at the end of a freeze of at least half a second."""
    u = estimate["u"]
    shares = [u[b - 1] / u[a - 1] for a, b in freezes(log, 0.5) if abs(u[a - 1]) > moving]
    return float(np.median(shares)) if shares else float("nan")


def measures(log: Log, estimate: Log) -> dict[str, float]:
    """All measures of the study of one observer on one run."""
    found = {f"rms_{name}": value for name, value in errors(log, estimate).items()}
    ends = [b for _, b in freezes(log)]
    for name in ("u", "v", "r"):
        found[f"lag_{name}"] = lag(log, estimate, name)
        found[f"noise_{name}"] = roughness(log, estimate, name)
        found[f"after_freeze_{name}"] = peak_after(log, estimate, ends, name)
        found[f"after_wrap_{name}"] = peak_after(log, estimate, wraps(log), name)
    found["held"] = held(log, estimate)
    last = np.array([estimate[name][-1] for name in SIGNALS])
    found["stuck"] = float(not (np.abs(last) < ABSURD).all())
    return found

"""Performance metrics of a run, 4.4.

The error is that of the true ship, not of its measurement. The scenario names the columns of the pose,
the target and the force (:class:`cosim.scenario.Roles`).
"""

from collections.abc import Container, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from rich.table import Table

from ..scenario.plans import TIME_TOLERANCE
from ..scenario.roles import DEFAULT_ROLES, Roles
from .log import Log

AXES = ("X", "Y", "N")


class Metric(NamedTuple):
    """One entry of ``metrics.json``."""

    name: str
    unit: str
    meaning: str


METRICS = (
    Metric("e_pos_rms", "m", "distance to the target, root mean square"),
    Metric("e_pos_max", "m", "distance to the target, largest"),
    Metric("cross_track_rms", "m", "cross-track error e, root mean square"),
    Metric("heading_rms", "rad", "heading error, root mean square"),
    Metric("ISE", "m2.s", "integral of e squared"),
    Metric("IAE", "m.s", "integral of |e|"),
    Metric("W", "J", "work: integral of the power P"),
    Metric("I_tau_dot", "N", "wear: total change of the commanded force"),
    Metric("IAEW", "m.s.J", "IAE times W"),
    Metric("IAEWWT", "m.s.J.N", "IAE times W times I_tau_dot"),
    Metric("IWWT", "J.N", "W times I_tau_dot"),
    Metric("from", "s", "first time that is used"),
    Metric("to", "s", "last time that is used"),
)
# Where the scenario states the role power.
ENERGY = Metric("energy", "J", "energy of the actuators: integral of their power")


class MetricsError(Exception):
    """A log from which the metrics cannot be computed; the message says why."""


def wrap(angle: np.ndarray) -> np.ndarray:
    """Angles [rad] brought to (-pi, pi]."""
    return angle - 2.0 * np.pi * np.ceil((angle - np.pi) / (2.0 * np.pi))


def cross_track(x: np.ndarray, y: np.ndarray, target: Sequence[np.ndarray]) -> np.ndarray:
    """Signed cross-track error [m], positive to starboard of the path, (4.57), corrected.

    Args:
        x, y: north and east position [m].
        target: x_t, y_t [m] and psi_t [rad].
    """
    x_t, y_t, psi_t = target
    return -np.sin(psi_t) * (x - x_t) + np.cos(psi_t) * (y - y_t)


def _commanded(log: Container[str], roles: Roles) -> tuple[str, ...]:
    """Columns of the commanded force: after limits where that is logged."""
    return roles.force if all(name in log for name in roles.force) else roles.requested_force


def read_columns(log: Container[str], roles: Roles) -> tuple[str, ...]:
    """The columns that the metrics read of a log with such columns."""
    return ("time", *roles.of("pose", "velocity", "target", "power"), *_commanded(log, roles))


def _require(log: Log, roles: Roles) -> tuple[str, ...]:
    """The columns that the metrics read, all present."""
    names = read_columns(log, roles)
    missing = [name for name in names if name not in log]
    if missing:
        raise MetricsError(f"the log lacks {', '.join(missing)}")
    return names


def _window(log: Log, start: float | None, stop: float | None, roles: Roles) -> dict[str, np.ndarray]:
    """The rows of a log in start <= time <= stop, with only the columns that are read."""
    names = _require(log, roles)
    time = np.asarray(log["time"], float)
    if not time.size:
        raise MetricsError("the log has no rows")
    low = -np.inf if start is None else start
    high = np.inf if stop is None else stop
    chosen = (time >= low - TIME_TOLERANCE) & (time <= high + TIME_TOLERANCE)
    if np.count_nonzero(chosen) < 2:
        raise MetricsError(
            f"fewer than two rows from {time[0] if start is None else start:g} s"
            f" to {time[-1] if stop is None else stop:g} s"
            f" (the log covers {time[0]:g} s to {time[-1]:g} s)"
        )
    places = np.flatnonzero(chosen)
    if places[-1] - places[0] == places.size - 1:
        chosen = slice(places[0], places[-1] + 1)
    part = {name: np.ascontiguousarray(np.asarray(log[name], float)[chosen]) for name in names}
    time = part["time"]
    for name, values in part.items():
        if not (finite := np.isfinite(values)).all():
            bad = np.flatnonzero(~finite)
            raise MetricsError(f"{name} is not finite at {time[bad[0]]:g} s")
    still = np.flatnonzero(np.diff(time) <= 0.0)
    if still.size:
        raise MetricsError(f"time does not increase after {time[still[0]]:g} s")
    return part


def _change(tau: Sequence[np.ndarray]) -> np.ndarray:
    """Euclidean norm of the change of a force from the sample before; 0 at the first."""
    change = np.zeros_like(tau[0])
    change[1:] = np.sqrt(sum((np.diff(force) ** 2 for force in tau), np.zeros(change.size - 1)))
    return change


def tracking(log: Log, roles: Roles = DEFAULT_ROLES) -> dict[str, np.ndarray]:
    """Errors, power and force rate at every sample, (4.54)-(4.57), corrected.

    Args:
        log: at least time, pose, velocity, target and commanded force.
        roles: the columns of these.

    Returns:
        ``time`` [s], ``e_pos`` distance to the target [m], ``cross_track`` signed [m], ``heading``
        error in (-pi, pi] [rad], ``P`` = |tau^T nu| [W] and ``tau_dot``, norm of the difference of
        the commanded force to the sample before, over the time between [N/s and N.m/s alike].

    Raises:
        MetricsError: a column is missing.
    """
    names = _require(log, roles)
    part = {name: np.asarray(log[name], float) for name in names}
    time = part["time"]
    x, y, psi = (part[name] for name in roles.pose)
    target = [part[name] for name in roles.target]
    tau = [part[name] for name in _commanded(log, roles)]
    tau_dot = np.zeros_like(time)
    tau_dot[1:] = _change(tau)[1:] / np.diff(time)
    u, v, r = (part[name] for name in roles.velocity)
    return {
        "time": time,
        "e_pos": np.hypot(target[0] - x, target[1] - y),
        "cross_track": cross_track(x, y, target),
        "heading": wrap(psi - target[2]),
        "P": np.abs(tau[0] * u + tau[1] * v + tau[2] * r),
        "tau_dot": tau_dot,
    }


def _integral(steps: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Running integral by the trapezoidal rule; ``steps`` are the times between the values [s]."""
    total = np.zeros_like(values)
    np.cumsum(0.5 * (values[1:] + values[:-1]) * steps, out=total[1:])
    return total


def _integrals(part: Log, errors: Log, roles: Roles) -> list[np.ndarray]:
    """ISE, IAE, W and I_tau_dot as they grow, from one window of a log and its tracking."""
    steps, e = np.diff(errors["time"]), errors["cross_track"]
    return [
        _integral(steps, e * e),
        _integral(steps, np.abs(e)),
        _integral(steps, errors["P"]),
        # The sum of the changes, so that no step size enters.
        np.cumsum(_change([part[name] for name in _commanded(part, roles)])),
    ]


def _with_products(ise: Any, iae: Any, work: Any, wear: Any) -> dict[str, Any]:
    """The metrics that integrals give, which are arrays or numbers."""
    return {
        "ISE": ise,
        "IAE": iae,
        "W": work,
        "I_tau_dot": wear,
        "IAEW": iae * work,
        "IAEWWT": iae * work * wear,
        "IWWT": work * wear,
    }


def over_time(
    log: Log,
    start: float | None = None,
    stop: float | None = None,
    roles: Roles = DEFAULT_ROLES,
) -> dict[str, np.ndarray]:
    """The integral metrics as they grow over time, (4.58)-(4.63).

    Args:
        log: columns as for :func:`tracking`.
        start, stop: first and last time used [s]; by default all of the log.
        roles: the columns to use.

    Returns:
        ``time`` [s], ``ISE`` [m2.s], ``IAE`` [m.s], ``W`` [J], ``I_tau_dot`` [N], ``IAEW``,
        ``IAEWWT`` and ``IWWT``, their products; all are 0 at the first sample.

    Raises:
        MetricsError: a column is missing, the window holds fewer than two rows or a value that is
            not finite, or time does not increase.
    """
    part = _window(log, start, stop, roles)
    with np.errstate(over="ignore", invalid="ignore"):
        integrals = _integrals(part, tracking(part, roles), roles)
        return {"time": part["time"], **_with_products(*integrals)}


def compute(
    log: Log,
    start: float | None = None,
    stop: float | None = None,
    roles: Roles = DEFAULT_ROLES,
) -> dict[str, float]:
    """All metrics of a run, (4.54)-(4.63).

    Integrals of e and P follow the trapezoidal rule; I_tau_dot is the sum of the changes of the
    commanded force, so it depends on the step only through changes between samples.

    Args:
        log: columns as for :func:`tracking`.
        start, stop: first and last time used [s]; by default all of the log.
        roles: the columns to use.

    Returns:
        The entries of :data:`METRICS`, in their order and units, and :data:`ENERGY`.

    Raises:
        MetricsError: as for :func:`over_time`, or a metric is too large for a number.
    """
    part = _window(log, start, stop, roles)
    with np.errstate(over="ignore", invalid="ignore"):
        errors = tracking(part, roles)
        totals = _with_products(*(values[-1] for values in _integrals(part, errors, roles)))
        found = {name: float(total) for name, total in totals.items()}
        found["e_pos_rms"] = _rms(errors["e_pos"])
        found["e_pos_max"] = float(np.max(errors["e_pos"]))
        found["cross_track_rms"] = _rms(errors["cross_track"])
        found["heading_rms"] = _rms(errors["heading"])
        if roles.power:
            taken = np.sum([part[name] for name in roles.power], axis=0)
            found[ENERGY.name] = float(_integral(np.diff(part["time"]), taken)[-1])
    found["from"] = float(part["time"][0])
    found["to"] = float(part["time"][-1])
    infinite = [name for name, value in found.items() if not np.isfinite(value)]
    if infinite:
        raise MetricsError(f"the run diverges: {', '.join(infinite)} too large to compute")
    return {metric.name: found[metric.name] for metric in (*METRICS, ENERGY) if metric.name in found}


def _rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values * values)))


def table(metrics: Mapping[str, float]) -> Table:
    """Metrics for the terminal: name, value to four digits, unit and meaning."""
    shown = Table(title="Performance", title_justify="left", box=None, pad_edge=False)
    shown.add_column("metric", style="bold", no_wrap=True)
    shown.add_column("value", justify="right", no_wrap=True)
    shown.add_column("unit", no_wrap=True)
    shown.add_column("meaning")
    for name, unit, meaning in (*METRICS, ENERGY):
        if name in metrics:
            shown.add_row(name, f"{metrics[name]:.4g}", unit, meaning)
    return shown

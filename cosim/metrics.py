"""Performance metrics of a run, 4.4: ``python -m cosim.metrics DIR [--from T] [--to T]``.

The error is that of the true vessel, not of its measurement. A log is a mapping from column name to a
one-dimensional array; the columns are those of ``log.csv``.
"""

import argparse
import json
import sys
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from rich.table import Table

from .command import Output, run_command
from .errors import InputError
from .files import whole
from .log import CSV, SIDECAR, read_log

Log = Mapping[str, np.ndarray]

AXES = ("X", "Y", "N")


def _columns(prefix: str) -> tuple[str, ...]:
    """The surge, sway and yaw columns of a force."""
    return tuple(prefix + axis for axis in AXES)


POSE = ("vessel.x", "vessel.y", "vessel.psi")
VELOCITY = ("vessel.u", "vessel.v", "vessel.r")
TARGET = ("guidance.x_t", "guidance.y_t", "guidance.psi_t")
TAU = _columns("controller.tau_")
TAU_CMD = _columns("thrusters.tau_cmd_")
TAU_LIN = _columns("controller.tau_lin_")
TAU_NONLIN = _columns("controller.tau_nonlin_")
OMEGA = _columns("vessel.omega_star_")
OMEGA_HAT = _columns("controller.omega_hat_")

# All that metrics are made from; the commanded force is the first of the two that is there.
INPUTS = (*POSE, *VELOCITY, *TARGET, *TAU_CMD, *TAU)

# All that metrics and plots read.
COLUMNS = (
    "time",
    *POSE,
    *VELOCITY,
    *TARGET,
    *TAU,
    *TAU_CMD,
    *TAU_LIN,
    *TAU_NONLIN,
    *OMEGA,
    *OMEGA_HAT,
)


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
    Metric("from", "s", "first time used"),
    Metric("to", "s", "last time used"),
)
OVER_TIME = ("ISE", "IAE", "W", "I_tau_dot", "IAEW", "IAEWWT", "IWWT")

TIME_TOLERANCE = 1e-9  # s


class MetricsError(Exception):
    """A log from which the metrics cannot be computed; the message says why."""


def needed(names: Iterable[str]) -> list[str]:
    """Those of the given column names that metrics and plots use, in the given order."""
    known = set(COLUMNS)
    return [name for name in names if name in known]


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


def _commanded(log: Log) -> tuple[str, ...]:
    """Columns of the commanded force: after clipping where thrusters are logged."""
    return TAU_CMD if all(name in log for name in TAU_CMD) else TAU


def _require(log: Log) -> tuple[str, ...]:
    """The columns the metrics read, all present."""
    names = ("time", *POSE, *VELOCITY, *TARGET, *_commanded(log))
    missing = [name for name in names if name not in log]
    if missing:
        raise MetricsError(f"the log lacks {', '.join(missing)}")
    return names


def _window(log: Log, start: float | None, stop: float | None) -> dict[str, np.ndarray]:
    """The rows of a log in start <= time <= stop, with only the columns that are read."""
    names = _require(log)
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
    part = {name: np.asarray(log[name], float)[chosen] for name in names}
    time = part["time"]
    for name, values in part.items():
        bad = np.flatnonzero(~np.isfinite(values))
        if bad.size:
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


def tracking(log: Log) -> dict[str, np.ndarray]:
    """Errors, power and force rate at every sample, (4.54)-(4.57), corrected.

    Args:
        log: at least time, the vessel's pose and velocity, the target and the commanded force.

    Returns:
        ``time`` [s], ``e_pos`` distance to the target [m], ``cross_track`` signed [m], ``heading``
        error in (-pi, pi] [rad], ``P`` = |tau^T nu| [W] and ``tau_dot``, norm of the difference of
        the commanded force to the sample before, over the time between [N/s and N.m/s alike].

    Raises:
        MetricsError: a column is missing.
    """
    names = _require(log)
    part = {name: np.asarray(log[name], float) for name in names}
    time = part["time"]
    x, y, psi = (part[name] for name in POSE)
    target = [part[name] for name in TARGET]
    tau = [part[name] for name in _commanded(log)]
    tau_dot = np.zeros_like(time)
    tau_dot[1:] = _change(tau)[1:] / np.diff(time)
    u, v, r = (part[name] for name in VELOCITY)
    return {
        "time": time,
        "e_pos": np.hypot(target[0] - x, target[1] - y),
        "cross_track": cross_track(x, y, target),
        "heading": wrap(psi - target[2]),
        "P": np.abs(tau[0] * u + tau[1] * v + tau[2] * r),
        "tau_dot": tau_dot,
    }


def _integral(time: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Running integral by the trapezoidal rule."""
    total = np.zeros_like(time)
    np.cumsum(0.5 * (values[1:] + values[:-1]) * np.diff(time), out=total[1:])
    return total


def _accumulate(part: Log, errors: Log) -> dict[str, np.ndarray]:
    """The metrics of :func:`over_time` from one window of a log and its tracking."""
    time, e = errors["time"], errors["cross_track"]
    ise = _integral(time, e * e)
    iae = _integral(time, np.abs(e))
    work = _integral(time, errors["P"])
    # The sum of the changes, so that no step size enters.
    wear = np.cumsum(_change([part[name] for name in _commanded(part)]))
    return {
        "time": time,
        "ISE": ise,
        "IAE": iae,
        "W": work,
        "I_tau_dot": wear,
        "IAEW": iae * work,
        "IAEWWT": iae * work * wear,
        "IWWT": work * wear,
    }


def over_time(log: Log, start: float | None = None, stop: float | None = None) -> dict[str, np.ndarray]:
    """The integral metrics as they grow over time, (4.58)-(4.63).

    Args:
        log: columns as for :func:`tracking`.
        start, stop: first and last time used [s]; by default all of the log.

    Returns:
        ``time`` [s], ``ISE`` [m2.s], ``IAE`` [m.s], ``W`` [J], ``I_tau_dot`` [N], ``IAEW``,
        ``IAEWWT`` and ``IWWT``, their products; all are 0 at the first sample.

    Raises:
        MetricsError: a column is missing, the window holds fewer than two rows or a value that is
            not finite, or time does not increase.
    """
    part = _window(log, start, stop)
    with np.errstate(over="ignore", invalid="ignore"):
        return _accumulate(part, tracking(part))


def compute(log: Log, start: float | None = None, stop: float | None = None) -> dict[str, float]:
    """All metrics of a run, (4.54)-(4.63).

    Integrals of e and P follow the trapezoidal rule; I_tau_dot is the sum of the changes of the
    commanded force, so it depends on the step only through what happens between samples.

    Args:
        log: columns as for :func:`tracking`.
        start, stop: first and last time used [s]; by default all of the log.

    Returns:
        The entries of :data:`METRICS`, in their order and units.

    Raises:
        MetricsError: as for :func:`over_time`, or a metric is too large for a number.
    """
    part = _window(log, start, stop)
    with np.errstate(over="ignore", invalid="ignore"):
        errors = tracking(part)
        found = {name: float(values[-1]) for name, values in _accumulate(part, errors).items()}
        found["e_pos_rms"] = _rms(errors["e_pos"])
        found["e_pos_max"] = float(np.max(errors["e_pos"]))
        found["cross_track_rms"] = _rms(errors["cross_track"])
        found["heading_rms"] = _rms(errors["heading"])
    found["from"] = float(part["time"][0])
    found["to"] = float(part["time"][-1])
    infinite = [metric.name for metric in METRICS if not np.isfinite(found[metric.name])]
    if infinite:
        raise MetricsError(f"the run grows without bound: {', '.join(infinite)} too large to compute")
    return {metric.name: found[metric.name] for metric in METRICS}


def _rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values * values)))


def table(metrics: Mapping[str, float]) -> Table:
    """Metrics for the terminal: name, value to four digits, unit and meaning."""
    shown = Table(title="Performance", title_justify="left", box=None, pad_edge=False)
    shown.add_column("metric", style="bold", no_wrap=True)
    shown.add_column("value", justify="right", no_wrap=True)
    shown.add_column("unit", no_wrap=True)
    shown.add_column("meaning")
    for name, unit, meaning in METRICS:
        if name in metrics:
            shown.add_row(name, f"{metrics[name]:.4g}", unit, meaning)
    return shown


def _write_csv(file: Path, columns: Mapping[str, np.ndarray]) -> None:
    """Write columns as CSV, whole or not at all."""
    with whole(file) as scratch:
        np.savetxt(
            scratch,
            np.column_stack(list(columns.values())),
            fmt="%.10g",
            delimiter=",",
            header=",".join(columns),
            comments="",
        )


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m cosim.metrics",
        description="Performance metrics of a finished run.",
        epilog="""\
examples:
  python -m cosim.metrics results/ellipse
  python -m cosim.metrics results/ellipse --from 20 --to 100
  python -m cosim.metrics results/ellipse --json
  python -m cosim.metrics results/ellipse --out results/ellipse/over_time.csv""",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("folder", metavar="DIR", type=Path, help="results of a run: holds log.csv")
    parser.add_argument(
        "--from", dest="start", metavar="T", type=float, help="first time used [s] (as in the scenario)"
    )
    parser.add_argument(
        "--to", dest="stop", metavar="T", type=float, help="last time used [s] (as in the scenario)"
    )
    parser.add_argument("--json", action="store_true", help="print JSON and nothing else")
    parser.add_argument("--out", metavar="FILE.csv", type=Path, help="write the metrics over time")
    return parser


def _read(folder: Path) -> dict[str, np.ndarray]:
    try:
        return read_log(folder, [*POSE, *VELOCITY, *TARGET, *TAU_CMD])
    except InputError:
        # A column is not there, or nothing is: reading all tells which.
        return read_log(folder)


def _window_of_run(folder: Path) -> tuple[float | None, float | None]:
    """First and last time [s] that the run's own metrics.json covers, as its scenario has it."""
    try:
        chosen = json.loads((folder / SIDECAR).read_text())["scenario"]["metrics"]
        return chosen["from"], chosen["to"]
    except (OSError, ValueError, KeyError, TypeError):
        return None, None


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; returns the exit code: 0 done, 2 bad input."""
    options: Any = _parser().parse_args(arguments)
    try:
        log = _read(options.folder)
        start, stop = _window_of_run(options.folder)
        start = start if options.start is None else options.start
        stop = stop if options.stop is None else options.stop
        metrics = compute(log, start, stop)
        if options.out is not None:
            if options.out.resolve().parent == options.folder.resolve() and options.out.name == CSV:
                raise InputError(f"'{options.out}' is the log itself")
            _write_csv(options.out, over_time(log, start, stop))
    except (InputError, MetricsError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    except OSError as error:
        print(f"error: '{options.out}' cannot be written: {error.strerror}", file=sys.stderr)
        return 2
    if options.json:
        print(json.dumps(metrics, indent=2))
    else:
        Output().print(table(metrics))
    return 0


if __name__ == "__main__":
    run_command(main)

"""Pictures over time: errors, metrics, forces, model error."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from .canvas import WIDTH, DrawnRun, Runs, finish, legend, plot, stacked
from .log import Log
from .performance import AXES, cross_track, over_time, wrap

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def _norm(log: Log, names: Sequence[str]) -> np.ndarray:
    return np.sqrt(sum((log[name] ** 2 for name in names), np.zeros_like(log["time"])))


def errors(runs: Runs) -> "Figure":
    """Heading error, cross-track error and distance to the target over time."""
    figure, panels = stacked(3, 1, 7.0)
    for run in runs:
        x, y, psi = (run.log[name] for name in run.stated.roles.pose)
        target = [run.log[name] for name in run.stated.roles.target]
        plot(panels[0, 0], run, np.degrees(wrap(psi - target[2])))
        plot(panels[1, 0], run, cross_track(x, y, target))
        plot(panels[2, 0], run, distance(run))
    panels[0, 0].set_ylabel("heading error [deg]")
    panels[1, 0].set_ylabel("cross-track error e [m]")
    panels[2, 0].set_ylabel("distance to target [m]")
    for panel in panels.flat:
        panel.axhline(0.0, color="0.4", linewidth=0.6, zorder=1)
    return finish(figure, panels, runs, least=1e-4)


def distance(run: DrawnRun) -> np.ndarray:
    """Distance of the ship to its target [m]."""
    (x, y, _), (x_t, y_t, _) = run.stated.roles.pose, run.stated.roles.target
    return np.hypot(run.log[x] - run.log[x_t], run.log[y] - run.log[y_t])


def commands(runs: Runs) -> "Figure":
    """Commands of the actuators with their limits, speed, and heading wanted and reached."""
    limits = {name: each for run in runs for name, each in run.stated.commands.items()}
    figure, panels = stacked(len(limits) + 2, 1, 1.0 + 1.6 * (len(limits) + 2))
    *each, speed, heading = panels.flat
    for run in runs:
        for panel, name in zip(each, limits, strict=True):
            if name in run.stated.commands:
                low, high, unit = run.stated.commands[name]
                factor = np.degrees(1.0) if unit == "rad" else 1.0
                plot(panel, run, factor * run.log[name])
                for end in (low, high):
                    panel.axhline(factor * end, color="0.4", linewidth=0.8, dashes=(5, 4), zorder=1)
        plot(speed, run, np.hypot(*(run.log[name] for name in run.stated.roles.velocity[:2])))
        psi, wanted = (
            np.unwrap(run.log[run.stated.roles.pose[2]]),
            run.log.get(run.stated.roles.target[2]),
        )
        plot(heading, run, np.degrees(psi))
        if wanted is not None:
            target = np.degrees(psi + wrap(wanted - psi))
            plot(heading, run, target, color="black", linestyle=":", label=f"{run.label}: wanted")
    for panel, (name, (*_, unit)) in zip(each, limits.items(), strict=True):
        panel.set_ylabel(f"{name.rpartition('.')[2]} [{'deg' if unit == 'rad' else unit}]")
    speed.set_ylabel("speed [m/s]")
    heading.set_ylabel("heading [deg]")
    each[0].plot([], [], color="0.4", linewidth=0.8, dashes=(5, 4), label="limit")
    wanted = [line for line in heading.get_lines() if str(line.get_label()).endswith(": wanted")]
    if wanted:
        each[0].plot([], [], color="black", linestyle=":", label="heading wanted")
    legend(figure, each[0], len(runs) + 2)
    return finish(figure, panels, (), least=1e-4)


GROWING = (
    ("ISE", "ISE [m² s]"),
    ("IAE", "IAE [m s]"),
    ("W", "W [J]"),
    ("I_tau_dot", "I_tau_dot [N]"),
    ("IAEW", "IAEW [m s J]"),
    ("IAEWWT", "IAEWWT [m s J N]"),
)


def metrics(runs: Runs) -> "Figure":
    """The integral metrics over time."""
    figure, panels = stacked(3, 2, 6.5)
    for run in runs:
        grown = over_time(run.log, run.stated.start, run.stated.stop, run.stated.roles)
        for panel, (name, _) in zip(panels.flat, GROWING, strict=True):
            plot(panel, run._replace(log=grown), grown[name])
    for panel, (_, label) in zip(panels.flat, GROWING, strict=True):
        panel.set_ylabel(label)
        panel.set_ylim(bottom=0.0)
    return finish(figure, panels, runs)


def forces(runs: Runs) -> "Figure":
    """Norms of the controller's linear, nonlinear and total force, (5.1); those that are not zero."""
    every = (
        ("linear", "linear_force"),
        ("nonlinear", "nonlinear_force"),
        ("total", "requested_force"),
    )
    parts = [
        part
        for part in every
        if any(np.any(run.log[name] != 0.0) for run in runs for name in run.stated.roles.of(part[1]))
    ] or [every[-1]]
    figure, panels = stacked(len(parts), 1, 1.0 + 1.85 * len(parts))
    for panel, (title, role) in zip(panels.flat, parts, strict=True):
        for run in runs:
            plot(panel, run, _norm(run.log, run.stated.roles.of(role)))
        panel.set_ylabel(f"{title} ‖τ‖ [N]")
        panel.set_ylim(bottom=0.0)
    return finish(figure, panels, runs)


def missing_force(run: DrawnRun) -> list[np.ndarray]:
    """The model error (7.7) on each axis [N, N, N m]: that of the hull, and the thrust that was lost.

    Of the latter only where the log tells it.
    """
    hull = [run.log[name] for name in run.stated.roles.model_error]
    if not all(name in run.log for name in run.stated.roles.of("force", "acting_force")):
        return hull
    pairs = zip(run.stated.roles.acting_force, run.stated.roles.force, strict=True)
    lost = [run.log[acting] - run.log[commanded] for acting, commanded in pairs]
    return [a + b for a, b in zip(hull, lost, strict=True)]


def model_error(runs: Runs) -> "Figure":
    """Model error and its estimate on each axis, one column of panels for each run."""
    figure, panels = stacked(3, len(runs), 6.5, max(WIDTH, 3.5 * len(runs)), sharey="row")
    for column, run in zip(panels.T, runs, strict=True):
        if len(runs) > 1:
            column[0].set_title(run.label, fontsize=10)
        for panel, true, estimate in zip(
            column, missing_force(run), run.stated.roles.estimate, strict=True
        ):
            # The thin black line stays visible on the estimate, and the estimate around it.
            plot(panel, run, true, color="black", linestyle="-", linewidth=0.9, zorder=3)
            plot(panel, run, run.log[estimate], linestyle="-", linewidth=1.8)
    for panel, axis in zip(panels[:, 0], AXES, strict=True):
        panel.set_ylabel(f"ω in {axis} [{'N m' if axis == 'N' else 'N'}]")
    # The estimates have the colours of their runs; the legend distinguishes the two lines.
    true, estimate = panels[0, 0].lines
    true.set_label("model error ω")
    estimate.set_label(None if len(runs) > 1 else "estimate ω̂")
    if len(runs) > 1:
        panels[0, 0].plot([], [], color="0.5", linewidth=1.8, label="estimate ω̂")
    legend(figure, panels[0, 0], 2)
    return finish(figure, panels, (), least=1e-4)

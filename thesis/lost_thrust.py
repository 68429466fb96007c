"""The estimated loss of thrust in yaw, and a bow thruster that fails: ``python -m thesis.lost_thrust``.

On the ellipse at constant speed the moment of the thrusters and the damping of the yaw rate go together,
so that N_r and delta_N trade against each other along a line on which the model error is explained
alike. Where on it the passes of (7.10)-(7.11) stand depends on gains, number of passes, and estimates
(7.2.4). The improved controller's own estimates of the losses through a failure: 7.2.5.
"""

from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np
from matplotlib.figure import Figure

from cosim.dispatch import FinishedRun
from studies.study_command import run_study, study_parser
from studies.study_report import Report, Verdict, records, stored

from .analysis import GAMMA, SETTLED, Samples, explained, material, model_error, one_pass
from .basin_trials import sysid4
from .basin_trials.trials import HARD, gains
from .monte_carlo import Content, run_all, shipped, vary
from .tracking.outcome import AXES, Log, missing

NU = ("u", "v", "r")
N_R, DELTA_N = 8, 13  # places of N_r in (7.2) and of delta_N after (7.5)
PASSES = (1, 4, 16)
# s; between the delays of the derivative filter in velocity (0.3 s) and in acceleration (0.5 s).
LATE = 0.45
PACES = (1.0, 0.25)  # of the gain of delta; chosen
RISE, ZERO = 0.3, 0.1  # of a loss of thrust: the thesis' rise, and what is close to zero (chosen)
FAILS, SECONDS = 140.0, 20.0  # s; when the bow thruster stops, and what counts as before and after
# FMU and ending of the signals, delay of the force [s].
ESTIMATES = {
    "true states": ("vessel", "", 0.0),
    "MDF": ("observer", "_hat", 0.0),
    f"MDF, force {LATE:g} s late": ("observer", "_hat", LATE),
}


class PassResult(NamedTuple):
    """Where the passes stand: delta_N [1], N_r [N m s/rad], R² of the model error in yaw."""

    delta_N: float
    N_r: float
    r2: float


def scenario() -> Content:
    """Two laps of the ellipse by backstepping with the gains of Table 6.4; SYSID4, no noise."""
    motion = [f"{name}{dot}" for name in NU for dot in ("", "_dot")]
    signals = [f"vessel.{name}" for name in motion] + [f"observer.{name}_hat" for name in motion]
    return vary(
        shipped("ellipse"),
        {"controller": "controller_bs.fmu"},
        sysid4.parameters() | gains(HARD),
        faults=[],
        metrics={},
        log={"signals": [*signals, *(f"thrusters.tau_cmd_{a}" for a in AXES)]},
    )


def failure() -> Content:
    """The ellipse by the improved controller; the bow thruster stops. Table 2.1, no noise."""
    dead = {"model": "thrusters", "variable": "loss_bow", "action": "override", "value": 1.0}
    return vary(
        shipped("ellipse"),
        {"controller": "controller_cl_improved.fmu"},
        faults=[],
        events=[{"time": FAILS, **dead}],
        metrics={},
        log={"signals": "all", "every": 10},
    )


def estimates(log: Log) -> np.ndarray:
    """Estimated losses of thrust (n, 3)."""
    return np.column_stack([log[f"controller.phi_hat_{k}"] for k in (12, 13, 14)])


class Failure(NamedTuple):
    """Estimated losses of thrust in three axes: mean of the SECONDS before, largest of those after."""

    before: tuple[float, ...]
    after: tuple[float, ...]


def around(log: Log) -> Failure:
    """The estimated losses around the failure."""
    time, delta = log["time"], estimates(log)
    before = delta[(time > FAILS - SECONDS) & (time < FAILS)].mean(axis=0)
    after = delta[(time > FAILS) & (time < FAILS + SECONDS)].max(axis=0)
    return Failure(tuple(before.tolist()), tuple(after.tolist()))


def seen(losses: Failure) -> list[Verdict]:
    """Whether the losses in sway and yaw rise by the thesis' 30 % within seconds, and from zero."""
    axes = dict(zip("YN", zip(losses.before[1:], losses.after[1:], strict=True), strict=True))
    numbers = (
        f"δ̂ in surge, sway, yaw, mean of the {SECONDS:g} s before: {listing(losses.before)}; largest of "
        f"the {SECONDS:g} s after: {listing(losses.after)}"
    )
    return [
        Verdict(
            "When the bow thruster fails, δ̂ in sway and yaw rises by 30 % or more in seconds (7.2.5)",
            {a: after - before >= RISE for a, (before, after) in axes.items()},
            f"by {RISE:g} or more; {numbers}",
        ),
        Verdict(
            "Before it δ̂ in sway and yaw is close to 0 (7.2.5)",
            {a: abs(before) < ZERO for a, (before, _) in axes.items()},
            f"below {ZERO:g}; as above",
        ),
    ]


def listing(values: Sequence[float]) -> str:
    return ", ".join(f"{x:.2f}" for x in values)


def failure_picture(log: Log) -> Figure:
    """Pose, z1, model error, and the estimated losses (Fig. 7.3)."""
    figure = Figure(figsize=(8.0, 9.0), layout="constrained")
    parts = {
        "pose [m, m, rad]": {n: log[f"vessel.{n}"] for n in ("x", "y", "psi")},
        "z1 [m, m, rad]": {n: log[f"controller.z1_{n}"] for n in ("x", "y", "psi")},
        "ω [N, N, N m]": {a: missing(log, a) for a in AXES},
        "δ̂": dict(zip(AXES, estimates(log).T, strict=True)),
    }
    panels = figure.subplots(len(parts), 1, sharex=True)
    for panel, (label, lines) in zip(panels, parts.items(), strict=True):
        for name, values in lines.items():
            panel.plot(log["time"], values, label=name, linewidth=1.0)
        panel.axvline(FAILS, color="black", linewidth=0.7)
        panel.set_ylabel(label)
        panel.legend(fontsize=7)
    panels[-1].set_xlabel("time [s]")
    return figure


def whole(run: FinishedRun) -> Log:
    """The log of a run that must have gone through."""
    run.demand()
    return dict(run.log)


def samples(log: Log, source: str, suffix: str, late: float) -> Samples:
    """Samples of a log by the true states or an observer, with the force so much late [s]."""
    rows = np.flatnonzero(log["time"] >= SETTLED)
    before = rows - round(late / (log["time"][1] - log["time"][0]))
    nu, nu_dot = (
        np.column_stack([log[f"{source}.{name}{dot}{suffix}"] for name in NU])[rows]
        for dot in ("", "_dot")
    )
    tau = np.column_stack([log[f"thrusters.tau_cmd_{a}"] for a in AXES])[before]
    run = np.full(rows.size, "ellipse")
    return Samples(run, log["time"][rows], nu, nu_dot, tau, model_error(nu, nu_dot, tau))


def places(s: Samples, pace: float) -> Iterator[PassResult]:
    """Where the estimate stands after each number of PASSES, with the gains of delta times a pace."""
    made, phi = material(s), np.zeros(GAMMA.size)
    gamma = GAMMA * np.where(np.arange(GAMMA.size) > 10, pace, 1.0)
    for count in range(1, PASSES[-1] + 1):
        phi = one_pass(phi, made, gamma)
        if count in PASSES:
            yield PassResult(float(phi[DELTA_N]), float(phi[N_R]), float(explained([s], phi)[2]))


def analyse(run: FinishedRun) -> dict[str, list[PassResult]]:
    """Estimates and pace -> places."""
    run.demand()
    return {
        f"{name}, {pace:g}": list(places(samples(run.log, *how), pace))
        for name, how in ESTIMATES.items()
        for pace in PACES
    }


def study(out: Path, again: bool = False) -> Path:
    """Run, or take the numbers of an earlier run, and write the report; returns its path."""
    earlier, log = stored(out) if again else None, {}
    if earlier is None:
        (found,) = run_all({"": scenario()}, [0], analyse)[""]
        (log,) = run_all({"": failure()}, [0], whole)[""]
        losses = around(log)
    else:
        found = records(PassResult, earlier["places"])
        losses = records(Failure, earlier["losses"])
    report = Report(out, "Loss of thrust in yaw: influences on its estimate", (), earlier)
    report.text(
        "Two laps of the ellipse at 0.08 m/s by backstepping, gains of Table 6.4, no noise; SYSID4 in "
        "the plant: delta_N = 0.31, N_r = -1.8. Passes of (7.10)-(7.11) from zero; gains of the "
        "improved controller, those of delta times the number given. Each cell: delta_N, N_r, R² of the "
        "model error in yaw."
    )
    rows = [
        [*name.rsplit(", ", 1), *(f"{p.delta_N:.3f}, {p.N_r:.2f}, {p.r2:.4f}" for p in each)]
        for name, each in found.items()
    ]
    header = ["estimates", "gain of delta", *(f"{n} pass{'es' * (n > 1)}" for n in PASSES)]
    report.table(header, rows)
    every = np.array([p[:2] for each in found.values() for p in each])
    slope, offset = np.polyfit(every[:, 0], every[:, 1], 1)
    off = np.abs(every[:, 1] - offset - slope * every[:, 0]).max()
    report.text(
        f"The line through them: N_r = {offset:.2f} + {slope:.2f} delta_N; at delta_N = 0.07 it "
        f"has N_r = {offset + 0.07 * slope:.2f}. The largest distance from it is {off:.2f} in N_r."
    )
    report.heading("A bow thruster that fails (7.2.5)")
    report.why("on the ellipse lost thrust and damping are nearly proportional; δ̂ is not zero before.")
    report.verdicts("failure", seen(losses))
    caption = f"Pose, z1, ω and δ̂; the bow thruster stops at {FAILS:g} s (Fig. 7.3)."
    report.figure("failure", partial(failure_picture, log), caption)
    report.result("losses", losses)
    report.result("places", found)
    report.result("line", [round(float(x), 9) for x in (slope, offset)])  # other LAPACKs agree so far
    return report.write()


def main(arguments: Sequence[str] | None = None) -> None:
    """Command line."""
    parser = study_parser(
        "thesis.lost_thrust",
        "Estimates of the loss of thrust in yaw by the passes of 7.2, over gains, passes and observers.",
        "  python -m thesis.lost_thrust",
        seeds=None,
        jobs=False,
        again=True,
    )
    options = parser.parse_args(arguments)
    run_study(partial(study, options.out, options.again))


if __name__ == "__main__":
    main()

"""The improved controller of 7.5: ``python -m thesis.improved``.

On the ellipse with SYSID4 hidden in the plant, the original controllers cannot learn the force that is
missing in surge, and lag behind; the improved one has regressors for it, (7.1)-(7.6), and does not.
"""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np
from matplotlib.figure import Figure

import cosim
from cosim.dispatch import FinishedRun
from fmus.controller.models import SURGE
from studies.study_command import progress, run_study, study_parser
from studies.study_report import Report, Verdict, records, stored

from .basin_trials import sysid4
from .error_models.lap_pictures import errors_picture, force_picture
from .monte_carlo import Content, SampleMean, interval, paired, run_all, run_each, shipped, vary
from .tracking.outcome import AXES, Log, missing, rms, true_states
from .tracking.verdict import finite_ratio, listed

IMPROVED = "controller_cl_improved"
ORIGINALS = ("controller_cl_win_eps", "controller_cl_win_z2", "controller_abs", "controller_bs")
SURGE_ONLY = "controller_cl_win_eps_surge"  # regressors of (7.1), no loss of thrust
CONTROLLERS = (IMPROVED, SURGE_ONLY, *ORIGINALS)
SENSES = ("mdf", "kalman", "true")
LAP = 99.0  # s
NO_LAG = 0.01  # m; a hundredth of the ship's length
LAG = 0.1  # m, a lag that a controller has surely; chosen
NOISE = 2e-4  # m, standard deviation of the measured position: a smaller error is none


class Lap(NamedTuple):
    """Numbers of the last lap of one run.

    Attributes:
        mean, size: z1_x, mean and RMS [m].
        aside: z1_y, RMS [m].
        error: of the estimated model error in surge, sway, yaw, RMS [N, N, N m].
        phi: mean estimates, in the order of (7.2) and (7.5).
        parts: surge force by the surge coefficients, by the loss, and both; estimate less truth [N].
    """

    mean: float
    size: float
    aside: float
    error: tuple[float, ...]
    phi: tuple[float, ...] = ()
    parts: tuple[float, ...] = ()


def surge_parts(log: Log, phi: Sequence[np.ndarray]) -> tuple[float, float, float]:
    """Mean error [N] of the surge force that the estimates explain by damping, by loss, and in all."""
    u, r, tau = log["vessel.u"], log["vessel.r"], log["thrusters.tau_cmd_X"]
    wrong = [p - true for p, true in zip(phi, sysid4.PHI, strict=True)]
    damping = wrong[0] * np.abs(u) * u + wrong[1] * u + wrong[2] * np.abs(u) * r
    loss = -wrong[11] * tau
    return float(damping.mean()), float(loss.mean()), float((damping + loss).mean())


def last_lap(run: FinishedRun) -> Lap:
    """The numbers of a run.

    Raises:
        SimulationError: it broke off.
    """
    run.demand()
    complete = run.log
    lap_time = complete["time"] >= max(complete["time"][-1] - LAP, 0.5 * complete["time"][-1])
    log = {name: column[lap_time] for name, column in complete.items()}
    z1 = log["controller.z1_x"]
    wrong = tuple(rms(log[f"controller.omega_hat_{a}"] - missing(log, a)) for a in AXES)
    lap = Lap(float(z1.mean()), rms(z1), rms(log["controller.z1_y"]), wrong)
    if "controller.phi_hat_14" not in log:
        return lap
    phi = [log[f"controller.phi_hat_{k}"] for k in range(1, 15)]
    return lap._replace(phi=tuple(float(x.mean()) for x in phi), parts=surge_parts(log, phi))


def variants(seconds: float) -> dict[str, dict[str, Content]]:
    """Sense -> controller -> scenario: two laps of the ellipse at 0.08 m/s, gains of Table 5.1."""
    base = vary(shipped("ellipse"), parameters=sysid4.parameters(), stop=seconds, metrics={})
    found: dict[str, dict[str, Content]] = {}
    for name in CONTROLLERS:
        plain = vary(base, {"controller": f"{name}.fmu"}, log={"signals": "all", "every": 2})
        for sense in ("mdf", "kalman"):
            found.setdefault(sense, {})[name] = vary(plain, {"observer": f"observer_{sense}.fmu"})
        found.setdefault("true", {})[name] = true_states(plain)
    return found


Found = Mapping[str, Mapping[str, Sequence[Lap]]]


def short(controller: str) -> str:
    """A controller as the report calls it."""
    return controller.removeprefix("controller_")


def column(laps: Sequence[Lap], name: str) -> list[float]:
    return [float(getattr(lap, name)) for lap in laps]


def claims(found: Found) -> list[Verdict]:
    """The thesis' statements on the improved controller, and the goals set here."""
    shares, means, others, aside = {}, {}, [], {}
    for sense, runs in found.items():
        for name in ORIGINALS:
            key = f"{sense}, {name.removeprefix('controller_')}"
            shares[key] = finite_ratio(column(runs[name], "size"), column(runs[IMPROVED], "size"))
            others.append(abs(interval(column(runs[name], "mean")).mean))
        means[sense] = interval(column(runs[IMPROVED], "mean"))
        aside[sense] = paired(column(runs[IMPROVED], "aside"), column(runs[ORIGINALS[0]], "aside"))
    remains = {s: interval(column(runs[IMPROVED], "aside")) for s, runs in found.items()}
    alone = {s: interval(column(runs[SURGE_ONLY], "mean")) for s, runs in found.items()}
    known = {
        s: finite_ratio(*([lap.error[0] for lap in runs[c]] for c in (SURGE_ONLY, IMPROVED)))
        for s, runs in found.items()
    }
    far = max(abs(x) for m in means.values() for x in m if np.isfinite(x))
    least = min(s.low if np.isfinite(s.low) and s.low > 0.0 else s.mean for s in shares.values())
    ratios = "; ".join(f"{k}: {s}" for k, s in shares.items())
    return [
        Verdict(
            "The improved controller drives z1 to zero in surge, the original cannot (7.5, Fig. 7.18a)",
            far < NO_LAG < LAG < min(others),
            f"mean z1_x of the last lap [m], below {NO_LAG:g} with its interval, above {LAG:g} with "
            f"every original: {'; '.join(f'{s}: {m}' for s, m in means.items())}; of the "
            f"originals between {-max(others):.3f} and {-min(others):.3f}",
        ),
        Verdict(
            "(goal) z1_x at least five times smaller than with every original",
            least >= 5.0,
            f"RMS of z1_x on the last lap, original over improved: {ratios}",
        ),
        Verdict(
            "(7.1) alone, without the loss of thrust, removes the lag in surge (7.5)",
            {s: abs(m.mean) < NO_LAG for s, m in alone.items()},
            f"mean z1_x of the last lap [m], below {NO_LAG:g}: {listed(alone)}; error of ω̂_X "
            f"over the improved one's: {listed(known)}",
        ),
        Verdict(
            "A little error remains in sway, less than before (7.5, Fig. 7.18)",
            {s: NOISE < remains[s].mean < NO_LAG and a.mean < 0.0 for s, a in aside.items()},
            f"RMS of z1_y on the last lap [m], between the pose's noise {NOISE:g} and {NO_LAG:g}: "
            + "; ".join(
                f"{s}: {remains[s]}, cl_win_eps {interval(column(r[ORIGINALS[0]], 'aside'))}"
                for s, r in found.items()
            ),
        ),
    ]


def coefficients(report: Report, found: Found) -> None:
    """Estimated and true coefficients, and which of them can be distinguished."""
    report.heading("Estimates of the improved controller and the truth")
    header = ["coefficient", "unit", "truth", *found]
    rows = []
    for k, (c, truth) in enumerate(zip(SURGE.coefficients, sysid4.PHI, strict=True)):
        each = [str(interval([lap.phi[k] for lap in runs[IMPROVED]])) for runs in found.values()]
        rows.append([c.name, c.unit, f"{truth:g}", *each])
    report.table(header, rows)
    report.text(
        "On an ellipse at constant speed u and τ_X hardly change: |u|u, u and the lost surge "
        "force have nearly the same ratio all the time, and so have r, |r|r and the lost moment. "
        "Their sums are estimated better than their parts, whose errors cancel: estimate minus "
        "truth of the surge force, by parts [N]."
    )
    names = ("damping", "loss", "both")
    parts = [
        [s, *(str(interval([lap.parts[k] for lap in runs[IMPROVED]])) for k in range(len(names)))]
        for s, runs in found.items()
    ]
    report.table(["observer", *names], parts)


def run(out: Path, seeds: Sequence[int], seconds: float, jobs: int | None) -> Found:
    """Sense -> controller -> last laps; the logs of the first seed stay in ``logs``."""
    todo = {f"{s}/{name}": c for s, each in variants(seconds).items() for name, c in each.items()}
    more = {key: [] if key.startswith("true/") else seeds[1:] for key in todo}
    logs = out / "logs"
    with progress(len(CONTROLLERS) * (2 * len(seeds) + 1), "improved") as advance:
        first = run_all(todo, seeds[:1], last_lap, logs, jobs, advance)
        rest = run_each(todo, more, last_lap, None, jobs, advance)
    return {s: {n: first[f"{s}/{n}"] + rest[f"{s}/{n}"] for n in CONTROLLERS} for s in SENSES}


def laps_of(draw: Callable[[Mapping[str, Log]], Figure], runs: Mapping[str, Path]) -> Figure:
    """A picture of logs."""
    return draw({name: cosim.read_log(folder) for name, folder in runs.items()})


def study(
    out: Path, seeds: Sequence[int], seconds: float, jobs: int | None, again: bool = False
) -> Path:
    """Run everything, or take the laps of an earlier run, and write the report; returns its path."""
    earlier = stored(out) if again else None
    found = run(out, seeds, seconds, jobs) if earlier is None else records(Lap, earlier["laps"])
    report = Report(out, "The improved controller (7.5)", seeds, earlier)
    report.text(
        "Two laps of the ellipse at 0.08 m/s, gains of Table 5.1; SYSID4 of Table 7.1 in the plant. "
        "Noise 0.2 mm and 0.3 mrad, freezes of 0.1 to 1 s once in 20 s; `true` is one run with the "
        "ship's own state. All numbers are of the second lap; means over the seeds with 95 % intervals."
    )
    report.why(
        "with (7.1) the controllers have regressors in surge, which (2.32) lacks; on an ellipse at "
        "constant speed damping and lost thrust are not distinguishable."
    )
    report.verdicts("claims", claims(found))
    report.heading("The last lap")
    header = ["observer", "controller", "mean z1_x [m]", "RMS z1_x [m]", "RMS z1_y [m]"]
    header += [f"error of ω̂_{a} [{'N m' if a == 'N' else 'N'}]" for a in AXES]
    report.table(header, [lap_row(s, name, laps) for s, r in found.items() for name, laps in r.items()])
    coefficients(report, found)
    report.heading("Pictures")
    seed = report.seeds[0]
    for sense in ("mdf", "kalman"):
        runs = {short(n): out / "logs" / sense / n / str(seed) for n in CONTROLLERS}
        files = zip(("trajectory", "errors", "metrics", "forces"), "abcd", strict=True)
        report.draw(sense, runs)
        for file, letter in files:
            report.picture(f"{sense}/{file}.png", f"{file}, {sense} (seed {seed}, Fig. 7.17{letter})")
        some = {n: runs[n] for n in ("cl_improved", "cl_win_eps_surge")}
        for name, letter, draw in (
            ("errors", "a", partial(laps_of, errors_picture, runs)),
            ("model_error", "b", partial(laps_of, force_picture, some)),
        ):
            caption = f"{name.replace('_', ' ')}, {sense} (seed {seed}, Fig. 7.18{letter})"
            report.figure(f"{name}_{sense}", draw, caption)
    report.result("laps", found)
    return report.write()


def lap_row(sense: str, name: str, laps: Sequence[Lap]) -> list[str]:
    """A line of the table of last laps."""
    cells: list[SampleMean] = [interval(column(laps, key)) for key in ("mean", "size", "aside")]
    cells += [interval([lap.error[k] for lap in laps]) for k in range(3)]
    return [sense, short(name), *map(str, cells)]


def main(arguments: Sequence[str] | None = None) -> None:
    """Command line."""
    parser = study_parser(
        "thesis.improved",
        "Compare the improved controller of 7.5 with the original ones, with SYSID4 in the plant.",
        "  python -m thesis.improved\n  python -m thesis.improved --quick --out results/first_look",
        again=True,
    )
    options = parser.parse_args(arguments)
    seeds = range(2 if options.quick else options.seeds)
    run_study(partial(study, options.out, seeds, 2.0 * LAP, options.jobs, options.again))


if __name__ == "__main__":
    main()

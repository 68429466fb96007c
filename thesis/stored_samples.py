"""Samples that are smoothed before they are stored (8.1): ``python -m thesis.stored_samples``.

The ellipse with noise and freezes by the derivative filter: error of the estimated model error on the
second lap, without smoothing, with a weighted mean, and with a fixed-point smoother.
"""

from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path

from studies.study_command import progress, run_study, study_parser
from studies.study_report import Report, Verdict, records, stored

from .basin_trials import sysid4
from .improved import LAP, Lap, last_lap
from .monte_carlo import Content, interval, run_all, shipped, vary
from .tracking.outcome import AXES, LEARNED_FROM
from .tracking.verdict import below, finite_ratio, listed

# Of each controller: the axis that is judged, what is hidden in the plant, and the settings; times [s].
WIN, IMPROVED = "controller_cl_win_eps", "controller_cl_improved"
AXIS = {WIN: "Y", IMPROVED: "X"}
HIDDEN = {WIN: {}, IMPROVED: sysid4.parameters()}
SETTINGS: Mapping[str, Mapping[str, Mapping[str, float]]] = {
    WIN: {"none": {}, "fixed_point 1": {"controller.fixed_point": 1.0}},
    IMPROVED: {
        "none": {"controller.smoothing": 0.0},
        "smoothing 2": {"controller.smoothing": 2.0},
        "fixed_point 1": {"controller.smoothing": 0.0, "controller.fixed_point": 1.0},
    },
}
LOGGED = [*LEARNED_FROM, "controller.z1_x", "controller.z1_y"]

Found = Mapping[str, Sequence[Lap]]


def variants(seconds: float) -> dict[str, Content]:
    """``controller|setting`` -> scenario."""
    base = vary(shipped("ellipse"), stop=seconds, metrics={}, log={"signals": LOGGED, "every": 2})
    return {
        f"{c}|{setting}": vary(base, {"controller": f"{c}.fmu"}, {**HIDDEN[c], **values})
        for c, each in SETTINGS.items()
        for setting, values in each.items()
    }


def errors(found: Found, controller: str, setting: str) -> list[float]:
    """RMS error of the estimated model error in the axis of a controller, by seed [N]."""
    return [lap.error[AXES.index(AXIS[controller])] for lap in found[f"{controller}|{setting}"]]


def claims(found: Found) -> list[Verdict]:
    """Whether smoothing makes the estimate better, seed by seed."""
    ratios = {
        f"{c.removeprefix('controller_')}, {setting}": finite_ratio(
            errors(found, c, setting), errors(found, c, "none")
        )
        for c, each in SETTINGS.items()
        for setting in each
        if setting != "none"
    }
    return [
        Verdict(
            "Samples that are smoothed before they are stored give a better estimate of ω (8.1)",
            {setting: below(x) for setting, x in ratios.items()},
            f"RMS error of ω̂ over that without smoothing, below 1 with its interval: {listed(ratios)}",
        )
    ]


def study(
    out: Path, seeds: Sequence[int], seconds: float, jobs: int | None, again: bool = False
) -> Path:
    """Run, or take the laps of an earlier run, and write the report; returns its path."""
    earlier, todo = stored(out) if again else None, variants(seconds)
    if earlier is None:
        with progress(len(todo) * len(seeds), "stored samples") as advance:
            found: Found = run_all(todo, seeds, last_lap, None, jobs, advance)
    else:
        found = records(Lap, earlier["laps"])
    report = Report(out, "Samples that are smoothed before they are stored (8.1)", seeds, earlier)
    report.text(
        "Two laps of the ellipse at 0.08 m/s by the modified derivative filter, noise 0.2 mm and 0.3 "
        "mrad, freezes of 0.1 to 1 s once in 20 s; all numbers are of the last lap. `smoothing`: a "
        "weighted mean over a span [s]; `fixed_point`: a fixed-point smoother with the measurements of "
        "a time after the sample [s]. SYSID4 of Table 7.1 is in the plant of the improved controller."
    )
    report.why(
        "the acceleration of a sample is noisier than its velocity; without smoothing the error differs "
        "from seed to seed, with the window by more than smoothing gains."
    )
    report.verdicts("claims", claims(found))
    report.table(
        ["controller", "setting", "axis", "RMS error of ω̂ [N]"],
        [
            [c, setting, AXIS[c], str(interval(errors(found, c, setting)))]
            for c, each in SETTINGS.items()
            for setting in each
        ],
    )
    report.result("laps", found)
    return report.write()


def main(arguments: Sequence[str] | None = None) -> None:
    """Command line."""
    parser = study_parser(
        "thesis.stored_samples",
        "Compare smoothers of the samples that concurrent learning stores (8.1).",
        "  python -m thesis.stored_samples",
        seeds=3,
        again=True,
    )
    options = parser.parse_args(arguments)
    seeds = range(2 if options.quick else options.seeds)
    run_study(partial(study, options.out, seeds, 2.0 * LAP, options.jobs, options.again))


if __name__ == "__main__":
    main()

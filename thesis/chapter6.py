"""The basin trials of chapter 6 in simulation: ``python -m thesis.chapter6``.

Four controllers follow both paths at two speeds with the gains of Table 6.4, through noise, freezes and
spikes, with and without the fault of the guidance. The plant hides what the thesis identified of the
real ship (SYSID4 of Table 7.1), or with ``--model`` what ``diagnosis.learn`` found of it. Each lesson
of 6.5 and each observation of 6.4.4 is held against the result.
"""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

import cosim
from diagnosis.predictors import read_model
from studies.study_command import run_study, study_parser
from studies.study_report import Report, Verdict, records, stored

from .basin_trials import sysid4
from .basin_trials.chapter6_runs import FEW, Plant, folder, run
from .basin_trials.found import FAULTY, Runs, TrialRuns, label, lost, mean
from .basin_trials.lessons import lessons
from .basin_trials.observations import observations, other_sections
from .basin_trials.store_contents import StoreContents
from .basin_trials.trials import CONTROLLERS, LABELS, TRIALS, Sailed, path_swing
from .error_models.lap_pictures import errors_picture
from .error_models.model_loops import parameters_of

# Of the thesis, by trial: 6.10 to 6.25.
FIRST_FIGURE = {trial.name: 10 + 4 * k for k, trial in enumerate(TRIALS)}
LEFT_OUT = "Experiments on spikes, stores and delay: not run for this ship (`--trials`)."


def table(report: Report, key: tuple[str, bool], runs: Runs) -> None:
    """The numbers of one trial."""
    names = ("position", "along", "cross_track", "heading", "lag", "inside", "omega_X", "iae", "work")
    names += ("iaew", "iaewwt", "swing")
    header = ["controller", "lost", "position [m]", "along the ship [m]", "cross-track [m]"]
    header += ["heading [rad]", "z1_x [m]"]
    header += ["inside by [m]", "ω in surge [N]", "IAE", "W", "IAEW", "IAEWWT", "swing [rad/s]"]
    report.text(f"**{label(*key)}**")
    rows = [[LABELS[c], str(lost(r)), *(str(mean(r, n)) for n in names)] for c, r in runs.items()]
    report.table(header, rows)


def pictures(report: Report) -> None:
    """The pictures of 6.4 for every trial, with the fault as in the basin (Figs. 6.10 to 6.25)."""
    for trial in TRIALS:
        name, place = label(trial.name, FAULTY), folder((trial.name, FAULTY))
        logs, seed = report.folder / "logs" / place, report.seeds[0]
        runs = {LABELS[c]: logs / c / str(seed) for c in CONTROLLERS}
        report.draw(place, runs)
        for file, number in numbered(FIRST_FIGURE[trial.name]).items():
            caption = f"{name}: {file.replace('_', ' ')} (seed {seed}, {number})"
            if file == "z1":
                report.figure(f"{place}_z1", partial(errors_of, runs), caption)
            else:
                report.picture(f"{place}/{file}.png", caption)


def errors_of(runs: Mapping[str, Path]) -> Figure:
    """z1 of logs."""
    return errors_picture({name: cosim.read_log(log) for name, log in runs.items()})


def numbered(first: int) -> dict[str, str]:
    """The six pictures of 6.4.1 with the thesis' numbers of a trial's figures."""
    numbers = (f"{first}", *(f"{first + k}{part}" for k in (1, 2) for part in "ab"), f"{first + 3}")
    names = ("trajectory", "errors", "z1", "metrics", "forces", "model_error")
    return {name: f"Fig. 6.{number}" for name, number in zip(names, numbers, strict=True)}


def of_section(rows: Sequence[Verdict], number: str) -> list[Verdict]:
    """Verdicts whose statements end with the number of the section."""
    return [row._replace(thesis=f"{row.thesis} {number}") for row in rows]


def hidden(model: Path | None) -> tuple[str, Plant]:
    """What is hidden in the plant, in words and as parameters.

    Raises:
        InputError: a file that is no parameter set of vessel and thrusters.
    """
    if model is None:
        text = (
            "Table 2.1 (corrected) with SYSID4 of Table 7.1: X_|u|u, X_u and X_|u|r added, the "
            "damping by the yaw rate replaced, 30 % of the surge force and 31 % of the yaw moment "
            "lost."
        )
        return text, sysid4.parameters()
    values = parameters_of(read_model(model))
    if not values:
        raise cosim.InputError(f"'{model}' holds no parameter of vessel or thrusters")
    listed = ", ".join(f"{name} = {value:.4g}" for name, value in values.items())
    return f"Table 2.1 (corrected) with the additions of `{model.name}`: {listed}.", values


def read(results: Mapping[str, Any]) -> TrialRuns:
    """The runs of an earlier study."""

    def group(name: str, kind: Callable[[str], Any]) -> dict[tuple[str, Any], Runs]:
        keys = {key: key.rpartition(", ")[::2] for key in results[name]}
        found = records(Sailed, results[name])
        return {(first, kind(last)): found[key] for key, (first, last) in keys.items()}

    return TrialRuns(
        group("trials", "True".__eq__),
        group("spiked", "True".__eq__),
        group("eight", "True".__eq__),
        group("delayed", float),
        records(StoreContents, results["stores"]),
    )


def study(
    out: Path,
    seeds: Sequence[int],
    shorter: float,
    jobs: int | None,
    model: Path | None = None,
    causes: bool = True,
    again: bool = False,
) -> Path:
    """Run everything, or take the runs of an earlier study, and write the report; returns its path."""
    text, plant = hidden(model)
    earlier = stored(out) if again else None
    found = run(out, seeds, shorter, jobs, plant, causes) if earlier is None else read(earlier)
    name = "SYSID4" if model is None else "the ship that was learned"
    report = Report(
        out, f"Chapter 6 in simulation, {name}: which lessons are reproduced?", seeds, earlier
    )
    report.text(
        f"Plant: {text} Controllers: gains of Table 6.4, without these additions in their model. "
        "Noise 0.2 mm and 0.3 mrad, freezes of 0.1 to 1 s once in 20 s, and once a minute a "
        "single sample that is 0.1 m and 0.1 rad off. `fault`: guidance set to a quarter of the "
        "speed, and called four times as often. The eight at 0.16 and 0.32 is 0.01-0.03 and "
        "0.02-0.067 m/s. Concurrent learning computes stored errors anew, except where it is `as "
        "printed`. "
        + (f"Experiments on delay and stores: {FEW} seeds at most." if found.spiked else LEFT_OUT)
    )
    report.why(
        "the thesis' measurements are not public, and another ship is hidden here; with the guidance "
        "fault RBS is lost at 0.16 m/s; most of the error is along the ship, where none adapts."
        if model is None
        else "the learned ship has no such loss of thrust as SYSID4, and every controller keeps up."
    )
    report.heading("The ellipse at 0.16 m/s (6.4.4)")
    report.verdicts("observations", of_section(observations(found), "(6.4.4)"))
    for section, rows in other_sections(found).items():
        report.heading(section)
        report.verdicts(section, of_section(rows, section[section.index("(6") :]))
    report.heading("Lessons learned (6.5)")
    report.verdicts("lessons", lessons(found), "numbers and cause")
    report.heading("The trials")
    report.text(
        "Means over the seeds with their 95 % intervals, over the runs that followed the target; "
        "`lost` is the number of the others. Position, its part along the ship, and z1_x over the "
        "second half, others from 20 s on. z1_x is the controller's, of the estimated pose, the "
        "rest is true. The swing has the yaw rate of the path in it, which is "
        + ", ".join(f"{path_swing(t):.2g} rad/s ({t.name})" for t in TRIALS)
        + "."
    )
    for key, runs in found.trials.items():
        table(report, key, runs)
    report.heading("Pictures")
    pictures(report)
    for name, group in found._asdict().items():
        flat = {str(k) if isinstance(k, str) else f"{k[0]}, {k[1]}": v for k, v in group.items()}
        report.result(name, flat)
    return report.write()


def main(arguments: Sequence[str] | None = None) -> None:
    """Command line."""
    parser = study_parser(
        "thesis.chapter6",
        "Run the basin trials of chapter 6 in simulation and check the lessons learned (6.5).",
        "  python -m thesis.chapter6 --seeds 3\n"
        "  python -m thesis.chapter6 --model results/learn/model.ssv --out results/chapter6_learned\n"
        "  python -m thesis.chapter6 --quick --out results/first_look",
        again=True,
    )
    parser.add_argument(
        "--model",
        type=Path,
        metavar="FILE",
        help="parameter set of the ship, as diagnosis.learn writes it (default: SYSID4)",
    )
    parser.add_argument(
        "--trials", action="store_true", help="the trials only, without the experiments on causes"
    )
    options = parser.parse_args(arguments)
    seeds, shorter = range(2 if options.quick else options.seeds), 0.25 if options.quick else 1.0
    causes = not options.trials
    run_study(
        partial(study, options.out, seeds, shorter, options.jobs, options.model, causes, options.again)
    )


if __name__ == "__main__":
    main()

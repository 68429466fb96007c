"""Learn what a model lacks: ``python -m diagnosis.learn TRAIN... [--test RUN...]``.

It gives three answers in growing order of time, each shown and written as soon as it is there: the
error of the initial model, its error with calibrated coefficients, and the effect that it lacks.
"""

if __name__ == "__main__":
    from cosim.supervision import supervised

    supervised()  # before all other imports, which take a while

import argparse
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from cosim import InputError
from cosim.command import FAILED, run_command

from .commands.command_line import (
    Done,
    command_of,
    execution_of,
    fmu_options,
    import_later_parts,
    inputs_of,
    moment,
    out_options,
    parser,
    prior,
    proposing,
    run,
)
from .execution.progress import Advance
from .execution.result_folder import together
from .search.methods import DEFAULT, METHODS, method
from .verdict.pruning_criteria import CRITERIA, PAIRED, criterion

if TYPE_CHECKING:
    from .session import Session

COMPARISON, CALIBRATED, CALIBRATION = EARLY = "comparison.json", "calibrated.ssv", "calibrated.json"
DIAGNOSIS, MODEL, POSTERIOR, REPORT, CSV, TEX = FILES = (
    "diagnosis.json",
    "model.ssv",
    "posterior.json",
    "report.html",
    "coefficients.csv",
    "coefficients.tex",
)
LATER = (DIAGNOSIS, REPORT, CSV, TEX)  # written when all is known
FMUS = (".fmu", ".ssp", ".json")
UNSOUND = "the learned model is not stable, see Stability; --allow-unstable writes it anyway"


def main(arguments: Sequence[str] | None = None) -> int:
    """Command line; returns the exit code."""
    return run(learn, _parser().parse_args(arguments))


def learn(options: argparse.Namespace, advance: Advance) -> Iterator[Done]:
    """Run the command with parsed options: the three answers, each when its files are there.

    Where the parameters of an FMU are calibrated, there is one answer.
    """
    if _calibrates_fmu(options):
        yield _learned_of_fmu(options, advance)
        return
    task = _begun(options, advance)
    yield _compared(task, options)
    task = task.with_likelier_commands()
    calibrated = _calibrated(task, options)
    if calibrated is not None:
        yield calibrated
    if not options.quick:
        yield _diagnosed(task, options, advance)


def _calibrates_fmu(options: argparse.Namespace) -> bool:
    """Whether parameters of an FMU are calibrated: they are named, or the FMU is not of a ship."""
    model = options.model
    if options.parameters is not None and (model is None or model.suffix not in FMUS):
        raise InputError("--parameters belongs to an FMU: --model NAME.fmu is missing")
    if model is None or model.suffix not in FMUS:
        return False
    from .fmu_parameters.system_task import is_system

    return options.parameters is not None or is_system(options.train, options.map)


def _learned_of_fmu(options: argparse.Namespace, advance: Advance) -> Done:
    """The one answer where the parameters of an FMU are calibrated."""
    if options.split:
        raise InputError("--split is of no use here: a parameter of an FMU has one value for all runs")
    from .fmu_parameters.output.learn_fmu import learn_fmu

    origin = {name: str(value) for name, value in _origin(options).items()}
    made_of = _task(options) | {
        name: None if path is None else str(path.resolve())
        for name, path in (("map", options.map), ("parameters", options.parameters))
    }
    report = learn_fmu(options, advance, origin, execution_of(options), made_of)
    return Done(0, report.shown(str(options.out)))


def _begun(options: argparse.Namespace, advance: Advance) -> "Session":
    """The runs and the model, read and checked."""
    from .assessment.gathering import gather  # only now: it takes a while to import
    from .predictors import DescribedShip, open_model, ship_of_model, ship_with
    from .runs import cut, read_each
    from .search import shares

    by = method(options.method)  # before any work: an unknown name, or a library that is missing
    criterion(options.pruning)
    craft = ship_with(options.effects, options.ship or ship_of_model(options.model))
    model = open_model(options.model, options.map, craft, execution_of(options))
    start = model.start
    if options.fit and not model.parametric:
        raise InputError(f"--fit needs a model with parameters; {model.name} has none")
    shares(craft, options.prior)
    learned = options.train
    if options.split:
        advance("reading")
        learned = cut(read_each(options.train, craft), options.split)
    paths = [*learned, *options.validate, *options.test]
    runs = gather(paths, advance, options.anyway, start, options.horizon, import_later_parts)
    from . import session
    from .search.prediction_fit.output_fit import fitted

    train, decide = len(learned), len(learned) + len(options.validate)
    if options.fit and start is not None:
        model = DescribedShip(fitted(runs[:train], start, options.prior, options.fit))
    parts = runs[:train], runs[decide:]
    with proposing():
        return session.begin(
            *parts,
            options.prior,
            model,
            advance,
            by=by,
            validate=runs[train:decide],
            pruning=options.pruning,
        )


def _compared(task: "Session", options: argparse.Namespace) -> Done:
    """First answer: the initial model against the runs. Files of an older result go away."""
    from .predictors import WRITTEN
    from .report import ReportData, file_content, show_comparison
    from .report.formatting import write_json

    report = ReportData.of(task.compare(), options.model, [COMPARISON])
    with together(options.out, [*dict.fromkeys((*EARLY, *FILES, *WRITTEN))]) as new:
        write_json(new / COMPARISON, file_content(report))
    return Done(0, [FIRST, *show_comparison(report, str(options.out))], more=True)


def _calibrated(task: "Session", options: argparse.Namespace) -> Done | None:
    """Second answer: the coefficients alone; None: there is none to fit, and a search follows."""
    from .predictors import write_model
    from .report import ReportData, calibration_content, show_calibration, write_report
    from .report.formatting import write_json

    calibrated, more = task.calibrate(), not options.quick
    left_out = [] if more else [LEFT_OUT]
    if calibrated is None:
        return None if more else Done(0, [NOTHING_TO_FIT, *left_out])
    files = [COMPARISON, CALIBRATED, CALIBRATION, *([] if more else [REPORT])]
    report = ReportData.of(calibrated.comparison, options.model, files)
    with together(options.out, files[1:]) as new:
        write_model(new / CALIBRATED, calibrated.model)
        write_json(new / CALIBRATION, calibration_content(calibrated, report, left_out))
        if not more:
            write_report(new / REPORT, report, task.advance, _origin(options))
    shown = show_calibration(calibrated, report, str(options.out))
    return Done(0, [SECOND, *shown, *left_out], more)


def _diagnosed(task: "Session", options: argparse.Namespace, advance: Advance) -> Done:
    """Third answer: which effect is missing."""
    from .predictors import WRITTEN
    from .report import ReportData, file_content, show_diagnosis, write_coefficients, write_report
    from .report.formatting import write_json

    possible = [*dict.fromkeys((*FILES, *WRITTEN))]
    diagnosis = task.diagnose()
    with together(options.out, possible) as new:
        refused, notes, predictor = "", [], diagnosis.comparison.predictor
        if not (diagnosis.sound or options.allow_unstable):
            refused = UNSOUND
        else:
            try:
                learned = diagnosis.learned.model
                notes = predictor.write(new, learned, [*task.train, *task.validate])
                if predictor.parametric:
                    made_of = _task(options) | {"measured_commands": diagnosis.measured}
                    diagnosis.posterior.write(new / POSTERIOR, learned.learned_from, made_of)
            except InputError as error:  # a parameter that no FMU would take
                refused = str(error)
        early = [name for name in EARLY if (options.out / name).exists()]
        files = [*early, *(name for name in possible if (new / name).exists() or name in LATER)]
        report = ReportData.of(diagnosis, options.model, files)
        write_json(new / DIAGNOSIS, file_content(report))
        write_coefficients(diagnosis, new / CSV, new / TEX)
        write_report(new / REPORT, report, advance, _origin(options))
    shown = [THIRD, *show_diagnosis(report, str(options.out)), *notes]
    if refused:
        return Done(FAILED, [*shown, f"{MODEL} is NOT written: {refused}"])
    return Done(0, shown)


def _task(options: argparse.Namespace) -> dict[str, object]:
    """What a diagnosis is made of, for ``cybership next``; paths are absolute."""
    ship, files = options.ship, [*options.train, *options.validate]
    return {
        "runs": [str(path.resolve()) for path in files],
        "model": None if options.model is None else str(options.model.resolve()),
        "effects": [str(path.resolve() if path.exists() else path) for path in options.effects],
        "ship": str(Path(ship).resolve()) if ship and ship.endswith(".toml") else ship,
        "prior": options.prior,
        "horizon": options.horizon,
        "anyway": options.anyway,
        "split": options.split,
    }


def _origin(options: argparse.Namespace) -> dict[str, object]:
    """What a report was made with."""
    return {"command": command_of("learn"), "SHA-256 of the input": inputs_of(options)}


FIRST = "Answer 1 of 3: the initial model compared with the runs\n"
SECOND = "Answer 2 of 3: the coefficients calibrated, without an effect\n"
THIRD = "Answer 3 of 3: the missing effect\n"
NOTHING_TO_FIT = (
    "Answer 2 of 3: the model has no coefficient to calibrate, or the runs do not identify them."
)
LEFT_OUT = (
    "Not computed with --quick: the search for a missing effect, its confidence, and the "
    f"stability of the learned model ({DIAGNOSIS}, {MODEL})."
)


def _parser() -> argparse.ArgumentParser:
    made = parser(
        "learn",
        "Learn from measured runs which physical effect a model lacks, and with what confidence.",
        "examples:  %(prog)s run1.csv run2.csv --test run3.csv\n"
        "           %(prog)s run1.csv run2.csv --quick\n"
        "           %(prog)s run1.csv run2.csv --validate run3.csv --test run4.csv\n"
        "           %(prog)s results/hidden_drag --prior 0 --out results/found\n"
        "           %(prog)s run1.csv --prior mass=0.01,thrust=0.5,X_u=0.1\n"
        "           %(prog)s run1.csv --effects my_effects.py\n"
        "           %(prog)s run1.csv run2.csv --split run1@131\n"
        "           %(prog)s run1.csv --model vendor.fmu --parameters parameters.json\n"
        "exit codes: 0 done, 2 bad input, 3 the learned model is not sound: model.ssv is not written,\n"
        "            130 interrupted (the files of answers that were shown are kept)",
    )
    made.add_argument(
        "train",
        type=Path,
        nargs="+",
        metavar="TRAIN",
        help="measured training run, or folder of a log",
    )
    for option, what in (
        (
            "--validate",
            "decide which effects are kept, and their confidence (default: folds of the training data)",
        ),
        ("--test", "are predicted and decide nothing; they show how much the error falls"),
    ):
        made.add_argument(
            option,
            type=Path,
            nargs="+",
            action="extend",
            metavar="RUN",
            default=[],
            help=f"runs that {what}",
        )
    made.add_argument(
        "--split",
        type=moment,
        action="append",
        metavar="RUN@SECONDS",
        default=[],
        help="a time at which a training run is cut, as something changed there: each part has values "
        "of its own, as a run has; may be repeated",
    )
    made.add_argument(
        "--quick",
        action="store_true",
        help="stop after the comparison and the calibration of the coefficients; do not search for "
        "effects",
    )
    made.add_argument(
        "--prior",
        type=prior,
        metavar="SHARE",
        help="relative standard deviation of every nominal coefficient, or, as in "
        "mass=0.01,thrust=0.5, of groups and single ones; 0: exact (default: by the source of each "
        "value)",
    )
    made.add_argument(
        "--fit",
        action="append",
        metavar="OUTPUT",
        default=[],
        help="a measured output of an actuator, as propeller.thrust; the actuator is fitted to it "
        "first (default: the measurement is compared, not fitted)",
    )
    made.add_argument(
        "--method",
        metavar="NAME",
        default=DEFAULT,
        help=f"method that selects effects: {', '.join(METHODS)}, or a FILE.py of your own "
        f"(default: {DEFAULT})",
    )
    made.add_argument(
        "--pruning",
        metavar="NAME",
        default=PAIRED,
        help=f"criterion by which effects are rejected: {', '.join(CRITERIA)}, or a FILE.py of your own "
        f"(default: {PAIRED})",
    )
    made.add_argument(
        "--parameters",
        type=Path,
        metavar="FILE.json",
        help="file of the parameters to calibrate, of an FMU given by --model; cybership parameters "
        "proposes it (a ship: none; else all that the runs identify)",
    )
    made.add_argument(
        "--allow-unstable",
        action="store_true",
        help="write model.ssv even if the learned model is not stable",
    )
    fmu_options(made)
    out_options(made, Path("results", "diagnosis"))
    return made


if __name__ == "__main__":
    run_command(main)

"""Learn what a model lacks: ``python -m diagnosis.learn TRAIN... [--test RUN...]``."""

if __name__ == "__main__":
    from cosim.supervision import supervised

    supervised()  # before all other imports, which take a while

import argparse
from collections.abc import Sequence
from pathlib import Path

from cosim import InputError
from cosim.command import FAILED, run_command

from .commands.command_line import (
    Done,
    command_of,
    import_later_parts,
    inputs_of,
    map_option,
    out_options,
    parser,
    prior,
    run,
)
from .execution.progress import Advance
from .execution.result_folder import together
from .search.methods import DEFAULT, METHODS, method
from .verdict.pruning_criteria import CRITERIA, criterion
from .verdict.pruning_criteria import USUAL as PAIRED

DIAGNOSIS, MODEL, POSTERIOR, REPORT, CSV, TEX = FILES = (
    "diagnosis.json",
    "model.ssv",
    "posterior.json",
    "report.html",
    "coefficients.csv",
    "coefficients.tex",
)
LATER = (DIAGNOSIS, REPORT, CSV, TEX)  # written when all is known


def main(arguments: Sequence[str] | None = None) -> int:
    """Command line; returns the exit code."""
    return run(learn, _parser().parse_args(arguments))


def learn(options: argparse.Namespace, advance: Advance) -> Done:
    """Run the command with parsed options."""
    from .assessment.gathering import gather  # only now: it takes a while to import
    from .commands.initial_model import initial_model, proposing
    from .predictors import WRITTEN, DescribedShip, ship_with
    from .search import shares

    by = method(options.method)  # before any work: an unknown name, or a library that is missing
    criterion(options.pruning)
    possible = [*dict.fromkeys((*FILES, *WRITTEN))]
    with together(options.out, possible) as new:
        craft = ship_with(options.effects, options.ship)
        model = initial_model(options.model, options.map, craft)
        start = model.start
        if options.fit and not model.parametric:
            raise InputError(f"--fit needs a model with parameters, which {model.name} does not have")
        shares(craft, options.prior)
        paths = [*options.train, *options.validate, *options.test]
        runs = gather(paths, advance, options.anyway, start, options.horizon, import_later_parts)
        from . import session
        from .report import ReportData, file_content, show_diagnosis, write_coefficients, write_report
        from .report.document import write_json
        from .search.prediction_fit.output_fit import fitted

        train, decide = len(options.train), len(options.train) + len(options.validate)
        if options.fit and start is not None:
            model = DescribedShip(fitted(runs[:train], start, options.prior, options.fit))
        with proposing():
            diagnosis = session.diagnose(
                runs[:train],
                runs[decide:],
                options.prior,
                model,
                advance,
                by=by,
                validate=runs[train:decide],
                pruning=options.pruning,
            )
        refused, notes, predictor = "", [], diagnosis.comparison.predictor
        if not (diagnosis.sound or options.allow_unstable):
            refused = UNSOUND
        else:
            try:
                notes = predictor.write(new, diagnosis.learned.model, runs)
                if predictor.parametric:
                    diagnosis.posterior.write(new / POSTERIOR)
            except InputError as error:  # a parameter that no FMU would take
                refused = str(error)
        files = [name for name in possible if (new / name).exists() or name in LATER]
        report = ReportData.of(diagnosis, options.model, files)
        write_json(new / DIAGNOSIS, file_content(report))
        write_coefficients(diagnosis, new / CSV, new / TEX)
        origin = {"command": command_of("learn"), "SHA-256 of the input": inputs_of(options)}
        write_report(new / REPORT, report, advance, origin)
    shown = [*show_diagnosis(report, str(options.out)), *notes]
    if refused:
        return Done(FAILED, [*shown, f"{MODEL} is NOT written: {refused}"])
    return Done(0, shown)


UNSOUND = "the learned model is not sound, see Stability; --allow-unstable writes it all the same"


def _parser() -> argparse.ArgumentParser:
    made = parser(
        "learn",
        "Learn from measured runs which physical effect a model lacks, and how sure that is.",
        "examples:  %(prog)s run1.csv run2.csv --test run3.csv\n"
        "           %(prog)s run1.csv run2.csv --validate run3.csv --test run4.csv\n"
        "           %(prog)s results/hidden_drag --prior 0 --out results/found\n"
        "           %(prog)s run1.csv --prior mass=0.01,thrust=0.5,X_u=0.1\n"
        "           %(prog)s run1.csv --effects my_effects.py\n"
        "exit codes: 0 done, 2 bad input, 3 the learned model is not sound: model.ssv is not written,\n"
        "            130 interrupted (nothing is written)",
    )
    made.add_argument(
        "train",
        type=Path,
        nargs="+",
        metavar="TRAIN",
        help="measured run to learn from, or folder of a log",
    )
    for option, what in (
        ("--validate", "decide what is kept and how sure it is (training data left out in turn)"),
        ("--test", "are predicted and decide nothing, to see the error fall"),
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
        "--prior",
        type=prior,
        metavar="SHARE",
        help="relative standard deviation of every nominal coefficient, or, as in mass=0.01,thrust=0.5, "
        "of groups and single ones; 0: exact (by where each value comes from)",
    )
    made.add_argument(
        "--fit",
        action="append",
        metavar="OUTPUT",
        default=[],
        help="a measured output of an actuator, as propeller.thrust, to fit that actuator to before "
        "anything else (default: such a measurement judges, and is not fitted)",
    )
    made.add_argument(
        "--method",
        metavar="NAME",
        default=DEFAULT,
        help=f"of identification: {', '.join(METHODS)}, or a FILE.py of your own ({DEFAULT})",
    )
    made.add_argument(
        "--pruning",
        metavar="NAME",
        default=PAIRED,
        help=f"criterion by which effects are rejected: {', '.join(CRITERIA)}, or a FILE.py of your own "
        f"({PAIRED})",
    )
    made.add_argument(
        "--allow-unstable", action="store_true", help="write model.ssv though it is not sound"
    )
    map_option(made)
    out_options(made, Path("results", "diagnosis"))
    return made


if __name__ == "__main__":
    run_command(main)

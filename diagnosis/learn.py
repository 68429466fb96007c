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
    MAP,
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

DIAGNOSIS, MODEL, POSTERIOR, REPORT, CSV, TEX = FILES = (
    "diagnosis.json",
    "model.ssv",
    "posterior.json",
    "report.html",
    "coefficients.csv",
    "coefficients.tex",
)
FOUND = "found.fmu"  # of an FMU with what was found
LATER = (DIAGNOSIS, REPORT, CSV, TEX)  # written when all is known


def main(arguments: Sequence[str] | None = None) -> int:
    """Command line; returns the exit code."""
    return run(learn, _parser().parse_args(arguments))


def learn(options: argparse.Namespace, advance: Advance) -> Done:
    """Run the command with parsed options."""
    from .commands.initial_model import initial_model, proposing, write_map
    from .gathering import gather  # only now: it takes a while to import
    from .predictors import ship_with
    from .search import shares

    method(options.method)  # before any work: an unknown name, or a library that is missing
    with together(options.out, (*FILES, FOUND, MAP)) as new:
        craft = ship_with(options.effects, options.ship)
        model, fmu = initial_model(options.model, options.map, craft)
        if fmu is not None and options.fit:
            raise InputError("--fit is for a model of this project, not for an FMU")
        shares(craft, options.prior)
        by = method(options.method)
        paths = [*options.train, *options.test]
        runs = gather(paths, advance, options.anyway, model, options.horizon, import_later_parts)
        from . import session
        from .predictors import write_model, write_wrapper
        from .report import diagnosis_content, show_diagnosis, write_coefficients, write_report
        from .search.prediction_fit.output_fit import fitted

        train = len(options.train)
        model = fitted(runs[:train], model, options.prior, options.fit)
        with proposing():
            diagnosis = session.diagnose(
                runs[:train], runs[train:], options.prior, fmu or model, advance, by=by
            )
        refused, use, notes = "", diagnosis.comparison.use, []
        if use is not None:
            told, map_of_it = write_wrapper(
                new / FOUND, use, diagnosis.start, diagnosis.learned.model, runs
            )
            notes = [told]
            write_map(new / MAP, (map_of_it or use.given).content())
        elif not (diagnosis.sound or options.allow_unstable):
            refused = UNSOUND
        else:
            try:
                write_model(new / MODEL, diagnosis.learned.model)
                diagnosis.posterior.write(new / POSTERIOR)
            except InputError as error:  # a parameter that no FMU would take
                refused = str(error)
        files = [name for name in (*FILES, FOUND, MAP) if (new / name).exists() or name in LATER]
        content = diagnosis_content(diagnosis, options.model, files)
        (new / DIAGNOSIS).write_text(content.model_dump_json(indent=2) + "\n", encoding="utf-8")
        write_coefficients(content, new / CSV, new / TEX)
        comparison = diagnosis.comparison
        origin = {"command": command_of("learn"), "SHA-256 of the input": inputs_of(options)}
        write_report(
            new / REPORT, content, comparison.evaluations, comparison.omega_std, advance, origin
        )
    shown = [*show_diagnosis(content, str(options.out)), *notes]
    if refused:
        return Done(FAILED, [*shown, f"{MODEL} is NOT written: {refused}"])
    return Done(0, shown)


UNSOUND = "the learned model is not sound, see Stability; --allow-unstable writes it all the same"


def _parser() -> argparse.ArgumentParser:
    made = parser(
        "learn",
        "Learn from measured runs which physical effect a model lacks, and how sure that is.",
        "examples:  %(prog)s run1.csv run2.csv --test run3.csv\n"
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
    made.add_argument(
        "--test",
        type=Path,
        nargs="+",
        action="extend",
        metavar="RUN",
        default=[],
        help="runs of which nothing is learned, to see the error fall",
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
        "--allow-unstable", action="store_true", help="write model.ssv though it is not sound"
    )
    map_option(made)
    out_options(made, Path("results", "diagnosis"))
    return made


if __name__ == "__main__":
    run_command(main)

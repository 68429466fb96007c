"""System identification by concurrent learning (7.2).

``python -m thesis.sysid RUN...``.
"""

if __name__ == "__main__":
    from cosim.supervision import supervised

    supervised()  # before all other imports, which take a while

import argparse
from collections.abc import Sequence
from pathlib import Path

from cosim import InputError
from cosim.command import run_command
from diagnosis.commands import Done, run
from diagnosis.execution import Advance, together

from .command_options import analysis_parser, ssv_option

RESULT, MODEL, REPORT = FILES = ("sysid.json", "model.ssv", "report.html")


def main(arguments: Sequence[str] | None = None) -> int:
    """Command line; returns the exit code."""
    return run(sysid, _parser().parse_args(arguments))


def sysid(options: argparse.Namespace, advance: Advance) -> Done:
    """Run the command with parsed options."""
    from diagnosis.predictors import write_model
    from diagnosis.report import write_document, write_json

    from .analysis import gather_samples, table_7_1  # only now: it takes a second to import
    from .analysis.sysid_report import content, document, result, sentences

    row = None if options.recipe is None else table_7_1.row(options.recipe)
    if row is None and not options.runs:
        raise InputError("needs a run to learn from, or --recipe SYSID1 to SYSID4")
    with together(options.out, FILES) as new:
        every = gather_samples(
            [*options.runs, *options.test], options.estimates, advance, anyway=options.anyway
        )
        runs, others = every[: len(options.runs)], every[len(options.runs) :]
        advance("passes")
        found = result(runs, others, row, options.recipe or "identified")
        written = options.ssv or found.thrust.holds
        if written:
            write_model(new / MODEL, table_7_1.plant(found.phi))
        write_json(new / RESULT, content(found, options.estimates))
        advance("report")
        write_document(new / REPORT, document(found, options.estimates))
    shown = [*sentences(found)]
    if not written:
        shown.append(f"{MODEL} is not written; --ssv writes it anyway.")
    files = [name for name in FILES if written or name != MODEL]
    return Done(0, [*shown, f"in {options.out}: {', '.join(files)}"])


def _parser() -> argparse.ArgumentParser:
    made = analysis_parser(
        "sysid",
        "Identify the coefficients of (7.1)-(7.5) by repeated passes of concurrent learning over runs "
        "of CyberShip Enterprise 1.",
        "examples:  %(prog)s results/ellipse --test results/eight\n"
        "           %(prog)s --recipe SYSID4 --out results/sysid4\n"
        "           python -m cosim.run scenarios/ellipse.json --parameters results/sysid4/model.ssv\n"
        "exit codes: 0 done, 2 bad input, 130 interrupted (nothing is written)",
        "smoothed",
        "*",
    )
    made.add_argument(
        "--test",
        type=Path,
        nargs="+",
        action="extend",
        metavar="RUN",
        default=[],
        help="test runs, not used for learning, for R² on other data",
    )
    made.add_argument(
        "--recipe", metavar="NAME", help="a row of Table 7.1 in place of learning: SYSID1 to SYSID4"
    )
    ssv_option(made)
    return made


if __name__ == "__main__":
    run_command(main)

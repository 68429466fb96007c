"""Principal components of runs, and samples that are outliers (3.1, 7.3).

``python -m thesis.pca RUN...``.
"""

if __name__ == "__main__":
    from cosim.supervision import supervised

    supervised()  # before all other imports, which take a while

import argparse
from collections.abc import Sequence

from cosim.command import run_command
from diagnosis.commands import Done, run, ship_option
from diagnosis.execution import Advance, together

from .command_options import analysis_parser

FILES = ("pca.json", "report.html")


def main(arguments: Sequence[str] | None = None) -> int:
    """Command line; returns the exit code."""
    return run(pca, _parser().parse_args(arguments))


def pca(options: argparse.Namespace, advance: Advance) -> Done:
    """Run the command with parsed options."""
    from diagnosis.predictors import ship_with
    from diagnosis.report import write_document, write_json

    from .analysis import gather_samples  # only now: it takes a second to import
    from .analysis.outlier_report import analyse, content, document, sentences

    of = ship_with((), options.ship)
    with together(options.out, FILES) as new:
        runs = gather_samples(options.runs, options.estimates, advance, of, options.anyway)
        advance("principal components")
        found = analyse(runs, options.components)
        write_json(new / FILES[0], content(found, options.estimates))
        advance("report")
        write_document(new / FILES[1], document(found, options.estimates))
    return Done(0, [*sentences(found), f"in {options.out}: {', '.join(FILES)}"])


def _parser() -> argparse.ArgumentParser:
    made = analysis_parser(
        "pca",
        "Principal components of model error, velocity and force, and the samples that are outliers.",
        "examples:  %(prog)s results/ellipse\n"
        "           %(prog)s run1.csv run2.csv --components 4 --out results/outliers\n"
        "exit codes: 0 done, 2 bad input, 130 interrupted (nothing is written)",
        "mdf",
    )
    ship_option(made)
    made.add_argument(
        "--components",
        type=int,
        metavar="A",
        help="components of the model (default: the fewest that explain 90 %%)",
    )
    return made


if __name__ == "__main__":
    run_command(main)

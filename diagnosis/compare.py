"""Compare a model with measured runs: ``python -m diagnosis.compare RUN...``."""

if __name__ == "__main__":
    from cosim.watch import watched

    watched()  # before all other imports, which take a while

import argparse
from collections.abc import Sequence
from pathlib import Path

from cosim.command import run_command

from .command_line import Done, command_of, inputs_of, out_options, parser, run
from .progress import Advance
from .result_folder import together

FILES = ("comparison.json", "report.html")


def main(arguments: Sequence[str] | None = None) -> int:
    """Command line; returns the exit code."""
    return run(compare, _parser().parse_args(arguments))


def compare(options: argparse.Namespace, advance: Advance) -> Done:
    """Run the command with parsed options."""
    from . import session  # only now: it takes a second to import
    from .gathering import gather
    from .model import Model, read_model, ship_with
    from .report import comparison_content, show_comparison, write_report

    with together(options.out, FILES) as new:
        craft = ship_with(options.effects, options.ship)
        model = read_model(options.model, craft) if options.model else Model(ship=craft)
        runs = gather(options.runs, advance, options.anyway, model, options.horizon)
        comparison = session.evaluate(runs, model, advance=advance)
        advance("where it fails")
        content = comparison_content(comparison, options.model, FILES)
        (new / "comparison.json").write_text(content.model_dump_json(indent=2) + "\n", encoding="utf-8")
        origin = {"command": command_of("compare"), "SHA-256 of the input": inputs_of(options)}
        write_report(
            new / "report.html", content, comparison.evaluations, comparison.omega_std, advance, origin
        )
    return Done(0, show_comparison(content, str(options.out)))


def _parser() -> argparse.ArgumentParser:
    made = parser(
        "compare",
        "Compare a model with measured runs: how large its error is, and where.",
        "examples:  %(prog)s run1.csv run2.csv\n"
        "           %(prog)s results/ellipse --model model.ssv --out results/after\n"
        "exit codes: 0 done, 2 bad input, 130 interrupted (nothing is written)",
    )
    made.add_argument(
        "runs", type=Path, nargs="+", metavar="RUN", help="measured run, or folder of a log"
    )
    out_options(made, Path("results", "comparison"))
    return made


if __name__ == "__main__":
    run_command(main)

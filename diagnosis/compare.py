"""Hold a model against measured runs: ``python -m diagnosis.compare RUN...``."""

import argparse
from collections.abc import Sequence
from functools import partial
from pathlib import Path

from cosim.command import run_command

from .command import Done, folder, load_effects, parser, run
from .folder import together
from .steps import Advance

FILES = ("comparison.json", "report.html")


def main(arguments: Sequence[str] | None = None) -> int:
    """Command line; returns the exit code."""
    return run(partial(compare, _parser().parse_args(arguments)))


def compare(options: argparse.Namespace, advance: Advance) -> Done:
    """Do what the options say."""
    load_effects(options.effects)
    from . import outcome, session  # only now: they import the vessel, which has the effects
    from .gathering import gather
    from .parameter_set import read_model
    from .report import write_report
    from .terminal import show_comparison

    with together(options.out, FILES) as new:
        model = read_model(options.model) if options.model else None
        found = session.confront(gather(options.runs, advance), model, advance=advance)
        advance("where it fails")
        result = outcome.comparison(found, options.model, FILES)
        (new / "comparison.json").write_text(result.model_dump_json(indent=2) + "\n", encoding="utf-8")
        content = result.model_dump(mode="json")
        write_report(new / "report.html", content, found.evidence, found.std, advance=advance)
    return Done(0, show_comparison(result, str(options.out)))


def _parser() -> argparse.ArgumentParser:
    made = parser(
        "compare",
        "Hold a model against measured runs: how far it goes wrong, and where.",
        "examples:  python -m diagnosis.compare run1.csv run2.csv\n"
        "           python -m diagnosis.compare results/ellipse --model model.ssv --out results/after\n"
        "exit codes: 0 done, 2 bad input, 130 interrupted (nothing is written)",
    )
    made.add_argument(
        "runs", type=Path, nargs="+", metavar="RUN", help="measured run, or folder of a log"
    )
    out = Path("results", "comparison")
    made.add_argument("--out", type=folder, metavar="DIR", default=out, help=f"result folder ({out})")
    return made


if __name__ == "__main__":
    run_command(main)

"""Compare a model with measured runs: ``python -m diagnosis.compare RUN...``."""

if __name__ == "__main__":
    from cosim.supervision import supervised

    supervised()  # before all other imports, which take a while

import argparse
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from cosim import InputError
from cosim.command import run_command

from .command_line import Done, command_of, inputs_of, out_options, parser, run
from .progress import Advance
from .result_folder import together

FILES = ("comparison.json", "report.html")
MAP = "map.json"


def main(arguments: Sequence[str] | None = None) -> int:
    """Command line; returns the exit code."""
    return run(compare, _parser().parse_args(arguments))


def compare(options: argparse.Namespace, advance: Advance) -> Done:
    """Run the command with parsed options."""
    from . import session  # only now: it takes a second to import
    from .foreign import SUFFIX, Fmu, UnmatchedError
    from .gathering import gather
    from .model import Model, read_model, ship_with
    from .report import comparison_content, show_comparison, write_report

    path: Path | None = options.model
    fmu = None if path is None or path.suffix != SUFFIX else Fmu(path, options.map)
    if options.map is not None and fmu is None:
        raise InputError(f"--map tells the variables of an FMU: --model NAME{SUFFIX} is missing")
    files = FILES if fmu is None else (*FILES, MAP)
    with together(options.out, (*FILES, MAP)) as new:
        craft = ship_with(options.effects, options.ship)
        model = Model(ship=craft) if path is None or fmu else read_model(path, craft)
        runs = gather(options.runs, advance, options.anyway, model, options.horizon)
        try:
            comparison = session.evaluate(runs, fmu or model, advance=advance)
        except UnmatchedError as error:
            raise InputError(f"{error}{_proposed(error.proposal)}") from None
        advance("where it fails")
        content = comparison_content(comparison, path, files)
        (new / "comparison.json").write_text(content.model_dump_json(indent=2) + "\n", encoding="utf-8")
        if fmu is not None:
            _write_map(new / MAP, fmu.given([w.run for w in runs]).content())
        origin = {"command": command_of("compare"), "SHA-256 of the input": inputs_of(options)}
        write_report(
            new / "report.html", content, comparison.evaluations, comparison.omega_std, advance, origin
        )
    return Done(0, show_comparison(content, str(options.out)))


def _write_map(path: Path, content: Mapping[str, Any]) -> None:
    path.write_text(json.dumps(content, indent=2, ensure_ascii=False) + "\n", encoding="utf-8")


def _proposed(content: Mapping[str, Any]) -> str:
    """Propose a map in the working directory, unless there is one; what a message says of that."""
    path = Path(MAP)
    if path.exists():
        return f"; complete '{MAP}' for --map, or remove it and another one is proposed"
    try:
        _write_map(path, content)
    except OSError:
        return "; --map FILE tells them"
    return f"; '{MAP}' has what is known: complete it, and give it by --map {MAP}"


def _parser() -> argparse.ArgumentParser:
    made = parser(
        "compare",
        "Compare a model with measured runs: how large its error is, and where.",
        "examples:  %(prog)s run1.csv run2.csv\n"
        "           %(prog)s results/ellipse --model model.ssv --out results/after\n"
        "           %(prog)s trial.csv --model vendor.fmu --map map.json\n"
        "exit codes: 0 done, 2 bad input, 130 interrupted (nothing is written, but map.json where "
        "an FMU's names do not tell enough)",
    )
    made.add_argument(
        "--map",
        type=Path,
        metavar="FILE.json",
        help="which variables of an FMU given by --model are which signals (as names and units tell)",
    )
    made.add_argument(
        "runs", type=Path, nargs="+", metavar="RUN", help="measured run, or folder of a log"
    )
    out_options(made, Path("results", "comparison"))
    return made


if __name__ == "__main__":
    run_command(main)

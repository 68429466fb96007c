"""Compare a model with measured runs: ``python -m diagnosis.compare RUN...``."""

if __name__ == "__main__":
    from cosim.supervision import supervised

    supervised()  # before all other imports, which take a while

import argparse
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from types import ModuleType
from typing import Any

from cosim import InputError
from cosim.command import printable, run_command

from .commands.command_line import (
    Done,
    command_of,
    execution_of,
    fmu_options,
    import_later_parts,
    inputs_of,
    out_options,
    parser,
    proposing,
    run,
)
from .execution.progress import Advance
from .execution.result_folder import together

COMPARISON, REPORT = FILES = ("comparison.json", "report.html")


def main(arguments: Sequence[str] | None = None) -> int:
    """Command line; returns the exit code."""
    return run(compare, _parser().parse_args(arguments))


def compare(options: argparse.Namespace, advance: Advance) -> Iterator[Done]:
    """Run the command with parsed options: the errors, then the report and the validation record."""
    from .acceptance.record import FILES as RECORD
    from .assessment.gathering import gather  # only now: it takes a while to import
    from .predictors import MAP, open_model, ship_of_model, ship_with
    from .report import ReportData, file_content, show_comparison, write_report
    from .report.formatting import write_json

    if options.criteria is None and (options.sign or options.learned or options.require_met):
        raise InputError(
            "--sign, --learned and --require-met belong to a record: --criteria FILE.json is missing"
        )
    criteria = None
    if options.criteria is not None:
        from .acceptance import read_criteria

        criteria = read_criteria(options.criteria)
    if options.sign is not None:
        from .acceptance import public_key

        public_key(options.sign)  # whose faults are reported before the work
    with together(options.out, (*FILES, MAP, *RECORD)) as new:
        craft = ship_with(options.effects, options.ship or ship_of_model(options.model))
        model = open_model(options.model, options.map, craft, execution_of(options))
        paths, start = options.runs, model.start
        runs = gather(paths, advance, options.anyway, start, options.horizon, import_later_parts)
        from . import session

        if criteria is not None:
            from .acceptance import refuse_unknown_ranges

            refuse_unknown_ranges(criteria.content, [w.smoothed for w in runs])
        with proposing():
            comparison = session.evaluate(runs, model, advance=advance)
        advance("where it fails")
        comparison.predictor.write(new)
        maps = [name for name in (MAP,) if (new / name).exists()]
        report = ReportData.of(comparison, options.model, [*FILES, *maps])
        write_json(new / COMPARISON, file_content(report))
    written = ReportData.of(comparison, options.model, [COMPARISON, *maps])
    yield Done(0, show_comparison(written, str(options.out)), more=True)
    with together(options.out, (REPORT, *RECORD)) as new:
        origin = {"command": command_of("compare"), "SHA-256 of the input": inputs_of(options)}
        write_report(new / REPORT, report, advance, origin)
        judged: list[str] = []
        code = 0
        if criteria is not None:
            from .acceptance import lines, validate

            advance("criteria")
            files = {name: getattr(options, name) for name in ("model", "map", "effects")}
            files["ship"] = options.ship if Path(options.ship or "").is_file() else None
            command = origin["command"]
            record = validate(comparison, criteria, options.learned, files, command)
            names = record.write_into(new, options.sign)
            code = int(options.require_met and not record.met)
            judged = ["Criteria", *(f"  {line}" for line in lines(record.content))]
            judged.append(f"  {', '.join(names)} in {options.out}")
    yield Done(code, [f"{REPORT} in {options.out}", *map(printable, judged)])


def _parser() -> argparse.ArgumentParser:
    made = parser(
        "compare",
        "Compare a model with measured runs: size and location of its error.",
        "examples:  %(prog)s run1.csv run2.csv\n"
        "           %(prog)s results/ellipse --model model.ssv --out results/after\n"
        "           %(prog)s trial.csv --model vendor.fmu --map map.json\n"
        "exit codes: 0 done, 1 a criterion is not met (with --require-met), 2 bad input,\n"
        "            130 interrupted (what was shown is kept, and map.json where an FMU's names do not "
        "suffice)",
    )
    fmu_options(made)
    made.add_argument(
        "runs", type=Path, nargs="+", metavar="RUN", help="measured run, or folder of a log"
    )
    made.add_argument(
        "--criteria",
        type=Path,
        metavar="FILE.json",
        help="criteria of agreement: judge them, and write a validation record",
    )
    made.add_argument(
        "--require-met", action="store_true", help="exit code 1 unless all criteria are met, for scripts"
    )
    made.add_argument(
        "--learned",
        type=Path,
        metavar="DIR",
        help="result folder of the learn command that made the model, for the uncertainty in the record",
    )
    made.add_argument(
        "--sign", type=Path, metavar="KEY.pem", help="private key (Ed25519) that signs the record"
    )
    out_options(made, Path("results", "comparison"))
    return made


class _Module(ModuleType):
    """``diagnosis.compare(...)`` is the same from Python."""

    def __call__(self, *runs: Any, **options: Any) -> Any:
        from .interactive import compare as from_python

        return from_python(*runs, **options)


sys.modules[__name__].__class__ = _Module

if __name__ == "__main__":
    run_command(main)

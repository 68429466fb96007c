"""The command line."""

import argparse
import json
import os
import threading
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from pathlib import Path

from cybership.command_arguments import command_parser, complain, positive, whole_number
from cybership.message_text import nearest
from cybership.scratch_folder import sweep
from fmus.build import BuildError, build
from fmus.declare import DeclarationError

from .examine import examine
from .fmu import FmuArchive
from .registry import RULES, Rule, in_order
from .report import Outcomes, as_json, listing, show
from .source import BadFileError

CLEAN, FINDINGS, BAD_INPUT = 0, 1, 2


def main(arguments: Sequence[str] | None = None) -> int:
    """Command line; returns 0 without findings, 1 with, 2 for bad input."""
    options = _parser().parse_intermixed_args(arguments)
    if options.list:
        print(listing(), end="")
        return CLEAN
    try:
        chosen = _chosen(options.only)
    except BadFileError as error:
        return _refuse(error)
    fmus, code = _open(options.files)
    if not fmus:
        return code
    sweep()
    outcomes = _examine_all(fmus, chosen, options)
    if options.json:
        print(json.dumps(as_json(fmus, chosen, outcomes), indent=1))
    else:
        with suppress(BrokenPipeError):
            show(fmus, chosen, outcomes)
    found = any(o.found for of in outcomes for o in of.values())
    return code or (FINDINGS if found else CLEAN)


def _refuse(error: Exception) -> int:
    complain(error)
    return BAD_INPUT


def _open(names: Sequence[str]) -> tuple[list[FmuArchive], int]:
    """FMUs that can be checked, all of ours without names, and BAD_INPUT if there are others."""
    fmus: list[FmuArchive] = []
    code = CLEAN
    for name in names or [None]:
        try:
            fmus += map(FmuArchive, build([]) if name is None else [_path(name)])
        except (BadFileError, BuildError, DeclarationError, OSError) as error:
            code = _refuse(error)
    return fmus, code


def _path(name: str) -> Path:
    """An FMU file; a bare name is one of ours."""
    path = Path(name)
    return path if path.exists() or path.name != name or path.suffix else build([name])[0]


def _chosen(names: Sequence[str]) -> list[Rule]:
    for name in names:
        if name not in RULES:
            raise BadFileError(f"no rule '{name}'{nearest(name, RULES)}")
    return [rule for rule in in_order() if not names or rule.name in names]


def _examine_all(
    fmus: Sequence[FmuArchive], chosen: Sequence[Rule], options: argparse.Namespace
) -> list[Outcomes]:
    """All FMUs, some at a time, with a bar on a terminal."""
    from rich.console import Console
    from rich.progress import Progress

    console = Console(stderr=True)
    stopped = threading.Event()
    with (
        Progress(console=console, transient=True, disable=not console.is_terminal) as bar,
        ThreadPoolExecutor(options.jobs) as pool,
    ):
        task = bar.add_task("checking", total=len(fmus) * len(chosen))

        def check(fmu: FmuArchive) -> Outcomes:
            run, done = not options.no_run, lambda: bar.advance(task)
            return examine(fmu, chosen, options.timeout, run, done, stopped)

        try:
            return list(pool.map(check, fmus))
        finally:
            stopped.set()
            pool.shutdown(cancel_futures=True)


def _parser() -> argparse.ArgumentParser:
    parser = command_parser(
        "fmus.check",
        "Check FMI 2.0 co-simulation FMUs, of this project or others, against the standard.",
        "examples:  %(prog)s\n"
        "           %(prog)s mine.fmu other.fmu\n"
        "           %(prog)s vessel --json\n"
        "           %(prog)s mine.fmu --no-run\n"
        "exit codes: 0 no findings, 1 findings, 2 bad input (the rest is checked), 130 interrupted\n"
        "An FMU is a program, and checking it runs it: --no-run only reads it.",
    )
    parser.add_argument(
        "files",
        nargs="*",
        metavar="FILE",
        help="FMU, or the name of one of this project (default: all of this project)",
    )
    parser.add_argument("--json", action="store_true", help="print everything as JSON, no table")
    parser.add_argument("--list", action="store_true", help="print all rules as Markdown")
    parser.add_argument(
        "--only",
        metavar="RULE",
        action="append",
        default=[],
        help="check only this rule; may be repeated",
    )
    parser.add_argument("--no-run", action="store_true", help="only read the FMU, do not run it")
    parser.add_argument(
        "--timeout",
        type=positive,
        default=60.0,
        metavar="S",
        help="time limit of each rule that runs the FMU [s] (60)",
    )
    parser.add_argument(
        "--jobs",
        type=whole_number(1),
        default=os.cpu_count() or 1,
        metavar="N",
        help="number of FMUs at a time (default: processors)",
    )
    return parser

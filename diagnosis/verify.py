"""Check a validation record: ``python -m diagnosis.verify validation.json``."""

import argparse
from collections.abc import Sequence
from pathlib import Path

from cosim import InputError
from cosim.command import BAD_INPUT, Output, command_parser, complain, printable, run_command

TOLD = {True: "holds    ", False: "DIFFERS  ", None: "unknown  "}


def main(arguments: Sequence[str] | None = None) -> int:
    """Command line; returns the exit code."""
    options = _parser().parse_args(arguments)
    from .acceptance import verify_record  # only now: it takes a second to import

    try:
        checks = verify_record(options.record, options.key)
    except InputError as error:
        complain(error)
        return BAD_INPUT
    output = Output(highlight=False, markup=False, soft_wrap=True)
    for check in checks:
        output.print(f"{TOLD[check.holds]}{printable(check.line)}")
    return int(any(check.holds is False for check in checks))


def _parser() -> argparse.ArgumentParser:
    made = command_parser(
        "diagnosis.verify",
        "Check a validation record: its signature, and whether data, model, criteria and "
        "report are those that it names.",
        "example:  %(prog)s results/comparison/validation.json --key public.pem\n"
        "exit codes: 0 all that can be checked holds, 1 something differs, 2 bad input",
    )
    made.add_argument("record", type=Path, metavar="RECORD", help="validation.json")
    made.add_argument(
        "--key",
        type=Path,
        metavar="FILE.pem",
        help="public key (Ed25519) of who must have signed (the one that the record names)",
    )
    return made


if __name__ == "__main__":
    run_command(main)

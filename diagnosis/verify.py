"""Check a validation record: ``python -m diagnosis.verify validation.json``."""

import argparse
from collections.abc import Sequence
from pathlib import Path

from cosim import InputError
from cosim.command import BAD_INPUT, Output, command_parser, complain, printable, run_command

SHOWN = {True: "holds      ", False: "DIFFERS    ", None: "NOT CHECKED"}


def main(arguments: Sequence[str] | None = None) -> int:
    """Command line; returns 0 where the record holds, 1 where it does not, 4 where points are open."""
    options = _parser().parse_args(arguments)
    from .acceptance import verify_record  # only now: it takes a second to import

    try:
        checks = verify_record(options.record, options.key, options.allow_missing)
    except InputError as error:
        complain(error)
        return BAD_INPUT
    output = Output(highlight=False, markup=False, soft_wrap=True)
    for check in checks:
        allowed = " (allowed)" if check.allowed else ""
        output.print(f"{SHOWN[check.holds]}  {printable(check.line)}{allowed}")
    unchecked = sum(c.holds is None and not c.allowed for c in checks)
    if any(check.holds is False for check in checks):
        output.print("The record does not hold.")
        return 1
    if unchecked:
        output.print(f"The record is not fully checked: {unchecked} of {len(checks)} points are open.")
        return 4
    rest = sum(check.allowed for check in checks)
    output.print("The record holds" + (f", but for {rest} points that are allowed." if rest else "."))
    return 0


def _parser() -> argparse.ArgumentParser:
    made = command_parser(
        "diagnosis.verify",
        "Check a validation record: its signature, and whether data, model, criteria, code and "
        "report are those that it names.",
        "example:  %(prog)s results/comparison/validation.json --key public.pem\n"
        "exit codes: 0 the record holds, 1 something differs, 4 something could not be checked,\n"
        "            2 bad input",
    )
    made.add_argument("record", type=Path, metavar="RECORD", help="validation.json")
    made.add_argument(
        "--key",
        type=Path,
        metavar="FILE.pem",
        help="public key (Ed25519) of the required signer (default: the key in the record, whose "
        "owner is not known)",
    )
    made.add_argument(
        "--allow-missing",
        action="append",
        default=[],
        metavar="NAME",
        help="accept that an item cannot be checked: signature, key, code, or a file by its name, its "
        "path or its role, such as data; may be repeated",
    )
    return made


if __name__ == "__main__":
    run_command(main)

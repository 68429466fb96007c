"""Print the JSON Schema of files that describe ships: ``python -m fmus.ships``."""

import argparse
import json
from collections.abc import Sequence

from cybership.command_arguments import program

from ..interruption import run_interruptible
from .ship_file import json_schema


def main(arguments: Sequence[str] | None = None) -> int:
    """Print it; returns the exit code."""
    argparse.ArgumentParser(
        prog=program("fmus.ships"),
        description="Print the JSON Schema of files that describe ships.",
        epilog="example:  %(prog)s > ship.schema.json",
    ).parse_args(arguments)
    print(json.dumps(json_schema(), indent=2, ensure_ascii=False))
    return 0


if __name__ == "__main__":
    run_interruptible(main)

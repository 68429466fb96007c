"""Print the JSON Schema of scenario files: ``python -m cosim.scenario``."""

if __name__ == "__main__":
    from cosim.supervision.supervising import supervised

    supervised()  # before all other imports, which take a while

import argparse
import json
from collections.abc import Sequence

from ..command import program, run_command
from .schema import json_schema


def main(arguments: Sequence[str] | None = None) -> int:
    """Print it; returns the exit code."""
    argparse.ArgumentParser(
        prog=program("cosim.scenario"),
        description="Print the JSON Schema of scenario files.",
        epilog="example:  %(prog)s > scenario.schema.json",
    ).parse_args(arguments)
    print(json.dumps(json_schema(), indent=2))
    return 0


if __name__ == "__main__":
    run_command(main)

"""Print a first file of criteria, or its JSON Schema: ``python -m diagnosis.criteria``."""

import argparse
import json
from collections.abc import Sequence

from cosim.command import Output, program, run_command


def main(arguments: Sequence[str] | None = None) -> int:
    """Print it; returns the exit code."""
    made = argparse.ArgumentParser(
        prog=program("diagnosis.criteria"),
        description="Print a template of criteria for compare --criteria, or their JSON Schema.",
        epilog="example:  %(prog)s > criteria.json",
    )
    made.add_argument("--schema", action="store_true", help="print the JSON Schema")
    options = made.parse_args(arguments)
    from .acceptance import json_schema, template  # only now: it takes a second to import

    content = json_schema() if options.schema else template()
    Output(highlight=False, markup=False, soft_wrap=True).print(json.dumps(content, indent=2))
    return 0


if __name__ == "__main__":
    run_command(main)

"""Print the JSON Schema of scenario files: ``python -m cosim.scenario``."""

if __name__ == "__main__":
    from cosim.interrupts import leave_on_interrupt

    leave_on_interrupt()  # before all other imports, which take a while

import json

from ..command import run_command
from .schema import json_schema


def main() -> int:
    """Print it; returns the exit code."""
    print(json.dumps(json_schema(), indent=2))
    return 0


if __name__ == "__main__":
    run_command(main)

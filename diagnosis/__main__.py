"""``python -m diagnosis`` tells which commands there are."""

if __name__ == "__main__":
    from cosim.supervision import supervised

    supervised()  # before all other imports, which take a while

import sys

from cosim.command import BAD_INPUT, complain, run_command

COMMANDS = """Compare a ship model with measurements, and learn which effect it lacks.

  python -m diagnosis.compare RUN...                  where is the model wrong?
  python -m diagnosis.learn TRAIN... [--test RUN...]  which physical effect is missing?

--help of each describes its options; docs/diagnosis.md explains the numbers."""


def main() -> int:
    """Print them; returns the exit code."""
    if wrong := [a for a in sys.argv[1:] if a not in ("-h", "--help")]:
        complain(
            f"unknown argument '{wrong[0]}'; the commands are diagnosis.compare and diagnosis.learn"
        )
        return BAD_INPUT
    print(COMMANDS)
    return 0


if __name__ == "__main__":
    run_command(main)

"""``python -m diagnosis`` tells which commands there are."""

if __name__ == "__main__":
    from cosim.supervision import supervised

    supervised()  # before all other imports, which take a while

from cosim.command import run_command

COMMANDS = """Compares a ship model with measurements, and learns what it lacks.

  python -m diagnosis.compare RUN...                  where does the model fail?
  python -m diagnosis.learn TRAIN... [--test RUN...]  which physical effect is missing?

Each tells more with --help; docs/diagnosis.md tells what the numbers mean."""


def main() -> int:
    """Print them; returns the exit code."""
    print(COMMANDS)
    return 0


if __name__ == "__main__":
    run_command(main)

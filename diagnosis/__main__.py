"""``python -m diagnosis`` tells which commands there are."""

import sys

COMMANDS = """Holds a ship model against measurements, and learns what it lacks.

  python -m diagnosis.compare RUN...                  where does the model fail?
  python -m diagnosis.learn TRAIN... [--test RUN...]  which physical effect is missing?

Each tells more with --help; docs/diagnosis.md tells what the numbers mean."""

if __name__ == "__main__":
    print(COMMANDS)
    sys.exit(0)

"""Detect thrusters that fail during a run (7.2.5).

``python -m thesis.watch RUN``.
"""

if __name__ == "__main__":
    from cosim.supervision import supervised

    supervised()  # before all other imports, which take a while

import argparse
from collections.abc import Sequence

from cosim.command import run_command
from diagnosis.commands import Done, run
from diagnosis.execution import Advance, together

from .command_options import open_loop_parser

FILES = ("watch.json", "report.html")


def main(arguments: Sequence[str] | None = None) -> int:
    """Command line; returns the exit code."""
    return run(watch, _parser().parse_args(arguments))


def watch(options: argparse.Namespace, advance: Advance) -> Done:
    """Run the command with parsed options."""
    from diagnosis.report import write_document, write_json  # only now: it takes a second to import

    from .open_loop import gather_source, play, watch_loop
    from .open_loop.thruster_report import WATCH, content, document, sentences

    with together(options.out, FILES) as new:
        advance("reading")
        source = gather_source(options.run, options.anyway)
        loop = watch_loop(options.run, WATCH, options.observer, options.scenario)
        played = play(source, loop, advance)
        write_json(new / FILES[0], content(played))
        advance("report")
        write_document(new / FILES[1], document(played))
    return Done(0, [*sentences(played), f"in {options.out}: {', '.join(FILES)}"])


def _parser() -> argparse.ArgumentParser:
    return open_loop_parser(
        "watch",
        "Detect whether a thruster lost force during a run of CyberShip Enterprise 1: which, when, with "
        "what probability.",
        "examples:  %(prog)s results/ellipse\n"
        "           %(prog)s run.csv --observer kalman --out results/thrusters\n"
        "The same in a closed loop: watch_thrusters.fmu, fed like a controller, and with the force by\n"
        '["thrusters.tau_cmd_*", "watch.tau_cmd_*"].\n'
        "exit codes: 0 done (also where none fails), 2 bad input, 130 interrupted (nothing is written)",
    )


if __name__ == "__main__":
    run_command(main)

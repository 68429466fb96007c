"""Feed a measured run to observer and controller FMUs open loop (7.1).

``python -m thesis.replay RUN``.
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

FILES = ("replay.json", "replay.csv", "report.html")


def main(arguments: Sequence[str] | None = None) -> int:
    """Command line; returns the exit code."""
    return run(replay, _parser().parse_args(arguments))


def replay(options: argparse.Namespace, advance: Advance) -> Done:
    """Run the command with parsed options."""
    from diagnosis.report import write_document, write_json  # only now: it takes a second to import

    from .open_loop import gather_source, loop_of, play
    from .open_loop.replay_report import content, document, sentences, write_series
    from .open_loop.replayed import replayed

    with together(options.out, FILES) as new:
        advance("reading")
        source = gather_source(options.run, options.anyway)
        loop = loop_of(options.run, options.controller, options.observer, options.scenario)
        played = play(source, loop, advance)
        advance("spikes")
        found = replayed(played)
        write_json(new / FILES[0], content(found))
        write_series(new / FILES[1], found)
        advance("report")
        write_document(new / FILES[2], document(found))
    return Done(0, [*sentences(found), f"in {options.out}: {', '.join(FILES)}"])


def _parser() -> argparse.ArgumentParser:
    made = open_loop_parser(
        "replay",
        "Feed a run of CyberShip Enterprise 1 to an observer and a controller in open loop: estimates "
        "and outputs, and the signals that were lost in transmission.",
        "examples:  %(prog)s results/ellipse --controller abs\n"
        "           %(prog)s run.csv --controller cl_win_eps --scenario "
        "scenarios/eight.json\n"
        "exit codes: 0 done, 2 bad input, 130 interrupted (nothing is written)",
    )
    made.add_argument(
        "--controller",
        required=True,
        metavar="NAME",
        help="a controller of this project, as abs, cl_win_eps, cl_improved, or a path of an FMU",
    )
    return made


if __name__ == "__main__":
    run_command(main)

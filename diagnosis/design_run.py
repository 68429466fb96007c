"""Design the next run: ``python -m diagnosis.design_run results/diagnosis``."""

if __name__ == "__main__":
    from cosim.supervision import supervised

    supervised()  # before all other imports, which take a while

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from pydantic import BaseModel, Field

from cosim import InputError
from cosim.command import command_parser, positive, run_command
from cosim.scenario import checked, find_parameters, json_content

from .commands.command_line import Done, out_options, run
from .execution.progress import Advance
from .execution.result_folder import together

if TYPE_CHECKING:
    from .design import Question

DIAGNOSIS, POSTERIOR, PLAN = "diagnosis.json", "posterior.json", "next.json"
NO_RUNS = (
    "'{}' does not state the runs that the diagnosis was made of, or is not there: no run is designed; "
    "the advice is that of the diagnosis"
)


class Task(BaseModel):
    """What a diagnosis was made of, in ``posterior.json``; paths are absolute."""

    runs: Annotated[list[Path], Field(min_length=1)]
    model: Path | None = None
    map: Path | None = None
    parameters: Path | None = None
    effects: list[str] = []
    ship: str | None = None
    prior: float | dict[str, float] | None = None
    horizon: float | None = None
    anyway: bool = False
    measured_commands: bool = False
    split: list[tuple[str, float]] = []


def main(arguments: Sequence[str] | None = None) -> int:
    """Command line; returns the exit code."""
    return run(design, _parser().parse_args(arguments))


def design(options: argparse.Namespace, advance: Advance) -> Done:
    """Run the command with parsed options."""
    folder: Path = options.diagnosis
    if options.simulate is not None:
        list(find_parameters([options.simulate]))  # whose faults are reported before the work
    content = _diagnosis(folder / DIAGNOSIS)
    task = _task(folder / POSTERIOR)
    if "parameters" in content:
        return _of_fmu(options, content, task, advance)
    if task is None:
        return _advised(options, content, folder)
    from .assessment.gathering import gather  # only now: it takes a while to import
    from .design import Question, plan_next
    from .design.designing import limits_of
    from .predictors import open_model, ship_of_model, ship_with
    from .runs import cut, read_each
    from .verdict.measured_commands import with_measured_commands

    limits = limits_of(options.minutes, options.basin)
    craft = ship_with([Path(e) for e in task.effects], task.ship or ship_of_model(task.model))
    start = open_model(task.model, ship=craft).start
    if start is None:
        return _advised(options, content, folder)
    parts = cut(read_each(task.runs, craft), task.split)
    runs = gather(parts, advance, task.anyway, start, task.horizon)
    if task.measured_commands:
        runs = [with_measured_commands(w) for w in runs]
    q = Question(runs, content, start, task.prior, limits, options.criterion, task.ship)
    if options.simulate is not None:
        return _played(options, q, advance)
    plan = plan_next(q, options.count, options.seed, advance)
    written = plan.write(options.out)
    return Done(0, [*plan.lines(), f"{', '.join(written)} in {options.out}"])


def _played(options: argparse.Namespace, q: "Question", advance: Advance) -> Done:
    """The whole sequence on a simulated ship."""
    from .design.sequential import play
    from .report.formatting import write_json

    rounds = play(q, options.simulate, options.out, options.count, options.seed, advance)
    shown, stated = [], []
    for n, r in enumerate(rounds, 1):
        effects = ", ".join(f"{name} {c:.0%}" for name, c in r.effects.items()) or "no effect"
        shown += [f"Round {n}", *(f"  {line}" for line in r.plan.lines()), f"  learned: {effects}"]
        stated.append({"folder": f"round_{n}", "verdict": r.verdict, "confidence": r.effects})
    certain = rounds[-1].certain
    end = "Every effect found is certain." if certain else "The effects do not become certain."
    content = rounds[0].plan.content() | {"rounds": stated, "certain": certain}
    with together(options.out, [PLAN]) as new:
        write_json(new / PLAN, content)
    return Done(0, [*shown, end, f"{PLAN} and a folder for each round in {options.out}"])


def _advised(options: argparse.Namespace, content: dict[str, Any], folder: Path) -> Done:
    """The written advice of a diagnosis, where nothing can be designed."""
    from .report.formatting import write_json

    effects = [*content["effects"], *content["possibilities"]]
    lines = [e["advice"] for e in effects if e["advice"]]
    lines = lines or ["The diagnosis leaves no candidates that a run could discriminate."]
    stated = {"runs": [], "inseparable": [], "advice": lines}
    with together(options.out, [PLAN]) as new:
        write_json(new / PLAN, stated)
    return Done(0, [f"note: {NO_RUNS.format(folder / POSTERIOR)}", *lines, f"{PLAN} in {options.out}"])


def _of_fmu(
    options: argparse.Namespace, content: dict[str, Any], task: Task | None, advance: Advance
) -> Done:
    """Inputs over time that determine the parameters of an FMU."""
    from .design.designing import limits_of
    from .fmu_parameters.planned_inputs import plan_inputs
    from .fmu_parameters.system_task import is_system, system_task

    path = options.diagnosis / DIAGNOSIS
    if task is None or task.model is None:
        raise InputError(f"'{path}' does not state its runs; learn again with this version")
    if not is_system(task.runs, task.map):
        raise InputError(
            f"'{path}' is of the parameters of a ship's FMU: learn without --parameters, and design "
            "the run for its effects"
        )
    runs: dict[str, Sequence[Path]] = {"train": task.runs}
    system = system_task(task.model, task.map, runs, task.parameters, task.horizon)
    fitted = {p["name"]: p["z"] for p in content["parameters"]}
    system.parameters = [p for p in system.parameters if p.name in fitted]
    if not fitted:
        raise InputError(f"'{path}' has no parameter that was fitted, so no input is designed")
    z = [fitted[p.name] for p in system.parameters]
    seconds = limits_of(options.minutes, None).seconds
    plan = plan_inputs(system, z, seconds, options.count, options.seed, advance)
    written = plan.write(options.out)
    return Done(0, [*plan.lines(), f"{', '.join(written)} in {options.out}"])


def _diagnosis(path: Path) -> dict[str, Any]:
    if not path.is_file():
        raise InputError(f"no diagnosis in '{path.parent}': give the result folder of cybership learn")
    content = json_content(path, "a diagnosis")
    if not isinstance(content, dict) or not {"effects", "possibilities", "verdict"} <= content.keys():
        raise InputError(f"'{path}' is not the result of cybership learn")
    return content


def _task(path: Path) -> Task | None:
    """What a diagnosis was made of; None: the file does not state it."""
    content = json_content(path, "a posterior") if path.exists() else {}
    if not isinstance(content, dict):
        raise InputError(f"'{path}' is not a posterior of cybership learn")
    return checked(Task, content["task"], f"'{path}', task", strict=False) if "task" in content else None


def _count(text: str) -> int:
    from .design import MOST_RUNS

    if not text.isdecimal() or not 1 <= int(text) <= MOST_RUNS:
        raise argparse.ArgumentTypeError(f"needs a whole number from 1 to {MOST_RUNS}, not '{text}'")
    return int(text)


def _criterion(text: str) -> str:
    from .design import check_criterion

    try:
        check_criterion(text)
    except InputError as error:
        raise argparse.ArgumentTypeError(str(error)) from None
    return text


def _seed(text: str) -> int:
    if not text.isdecimal() or int(text) >= 2**31:
        raise argparse.ArgumentTypeError(f"needs a whole number from 0 to {2**31 - 1}, not '{text}'")
    return int(text)


def _parser() -> argparse.ArgumentParser:
    made = command_parser(
        "diagnosis.design_run",
        "Design the run that discriminates the candidate causes that a diagnosis leaves.",
        "examples:  %(prog)s results/diagnosis\n"
        "           %(prog)s results/diagnosis --minutes 4 --basin 6x4\n"
        "           %(prog)s results/diagnosis --basin basin.json\n"
        "           %(prog)s results/diagnosis --runs 3 --out results/plan\n"
        "           %(prog)s results/diagnosis --simulate truth.ssv --runs 4\n"
        'basin.json:  {"north": [0, 10], "east": [-3, 3]}\n'
        "exit codes:  0 done, 2 bad input, 130 interrupted",
    )
    made.add_argument(
        "diagnosis", type=Path, metavar="DIAGNOSIS", help="result folder of cybership learn"
    )
    made.add_argument(
        "--minutes", type=positive, default=4.0, metavar="M", help="length of a run [min] (default: 4)"
    )
    made.add_argument(
        "--basin",
        metavar="NORTHxEAST|FILE",
        help="length to the north and to the east [m] about the middle of the measured tracks, or a "
        "JSON file with the walls (default: what the runs have used, and a ship's length more)",
    )
    made.add_argument(
        "--runs",
        type=_count,
        default=1,
        dest="count",
        metavar="N",
        help="runs to design, or rounds to simulate (default: 1)",
    )
    made.add_argument(
        "--criterion",
        type=_criterion,
        default="certainty",
        metavar="NAME",
        help="certainty, box-hill, buzzi-ferraris, d-optimal or a-optimal (default: certainty)",
    )
    made.add_argument(
        "--seed", type=_seed, default=0, metavar="N", help="seed of everything random (default: 0)"
    )
    made.add_argument(
        "--simulate",
        type=Path,
        metavar="TRUTH.ssv",
        help="simulate the designed runs with a ship of these parameters, and learn again after each, "
        "until every effect is certain",
    )
    out_options(made, Path("results", "next"))
    return made


if __name__ == "__main__":
    run_command(main)

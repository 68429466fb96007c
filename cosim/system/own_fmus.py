"""The FMUs that a scenario names: files, and the project's own, built when needed."""

import signal
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path, PurePath

from ..compiled.library import compiles
from ..errors import InputError
from ..fmu.fmu_model import FmuModel
from ..interrupts import INTERRUPTED
from ..scenario.schema import Scenario


def read_models(scenario: Scenario, warnings: list[str]) -> dict[str, FmuModel]:
    """Instance -> FMU; instances of one file share it.

    Args:
        scenario: what to run.
        warnings: receives oddities that are no reason to refuse.

    Raises:
        InputError: no such FMU, or one that cannot be read.
    """
    bare = {e.path for e in scenario.fmus.values() if PurePath(e.path).name == e.path}
    # A bare name is the project's own FMU; only one that the project lacks may be a file in the folder.
    beside = sorted(name for name in bare if (scenario.folder / name).is_file())
    paths = _own_fmus(sorted(bare.difference(beside)), scenario, warnings)
    for name in beside:
        try:
            paths |= _own_fmus([name], scenario, warnings)
            warnings.append(f"'{name}' next to the scenario is not used; './{name}' names that file")
        except InputError:
            paths[name] = scenario.folder / name
    every = {n: paths.get(e.path) or scenario.folder / e.path for n, e in scenario.fmus.items()}
    models = {path: FmuModel(path) for path in dict.fromkeys(every.values())}
    return {instance: models[path] for instance, path in every.items()}


def _own_fmus(names: Sequence[str], scenario: Scenario, warnings: list[str]) -> dict[str, Path]:
    """Paths of the project's own FMUs for a scenario, built if need be."""
    if not names:
        return {}
    options = builder_options(scenario, compiles(scenario.native))
    built = run_builder(*options, "--", *names, warnings=warnings)
    return dict(zip(names, map(Path, built), strict=True))


def builder_options(scenario: Scenario, native: bool) -> list[str]:
    """What the builder gets of the FMUs of a scenario.

    Args:
        scenario: names the ship.
        native: whether to compile.
    """
    ship = [] if scenario.ship is None else [f"--ship={scenario.ship_source}"]
    return ["--native", *ship] if native else ship


def run_builder(*arguments: str | Path, warnings: list[str] | None = None) -> list[str]:
    """Run the project's FMU builder in a process of its own.

    Args:
        arguments: of ``python -m fmus.build``.
        warnings: receives what it notes.

    Returns:
        The lines that it prints.

    Raises:
        InputError: the last line of its complaint.
        KeyboardInterrupt: the builder was interrupted.
    """
    done = subprocess.run(
        [sys.executable, "-m", "fmus.build", *arguments], capture_output=True, text=True, check=False
    )
    if done.returncode in (INTERRUPTED, -signal.SIGINT):
        raise KeyboardInterrupt
    if done.returncode != 0:
        reason = done.stderr.strip().splitlines()[-1:] or ["python -m fmus.build failed"]
        raise InputError(reason[0].removeprefix("error: "))
    if warnings is not None:
        lines = done.stderr.splitlines()
        warnings += [line.removeprefix("note: ") for line in lines if line.startswith("note: ")]
    return done.stdout.splitlines()

"""The FMUs that a scenario names: files, and the project's own, built when they are needed."""

import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path, PurePath

from .errors import InputError
from .fmu import Model
from .scenario import Scenario


def read_models(scenario: Scenario, warnings: list[str]) -> dict[str, Model]:
    """Instance -> FMU; instances of one file share it.

    Args:
        scenario: what to run.
        warnings: receives what is odd but no reason to refuse.

    Raises:
        InputError: no such FMU, or one that cannot be read.
    """
    bare = {e.path for e in scenario.fmus.values() if PurePath(e.path).name == e.path}
    # A bare name means the project's own FMU; only one that the project lacks may be a file beside.
    beside = sorted(name for name in bare if (scenario.folder / name).is_file())
    paths = _own_fmus(sorted(bare.difference(beside)))
    for name in beside:
        try:
            paths |= _own_fmus([name])
            warnings.append(f"'{name}' beside the scenario is not used; './{name}' would mean that file")
        except InputError:
            paths[name] = scenario.folder / name
    models: dict[Path, Model] = {}
    found: dict[str, Model] = {}
    for instance, entry in scenario.fmus.items():
        path = paths.get(entry.path) or scenario.folder / entry.path
        if path not in models:
            models[path] = Model(path)
        found[instance] = models[path]
    return found


def _own_fmus(names: Sequence[str]) -> dict[str, Path]:
    """Paths of the project's own FMUs, built if need be."""
    if not names:
        return {}
    return dict(zip(names, map(Path, fmu_builder("--", *names)), strict=True))


def fmu_builder(*arguments: str) -> list[str]:
    """Lines that the project's FMU builder prints, in a process of its own.

    Raises:
        InputError: what it complains of.
    """
    done = subprocess.run(
        [sys.executable, "-m", "fmus.build", *arguments], capture_output=True, text=True, check=False
    )
    if done.returncode != 0:
        reason = done.stderr.strip().splitlines()[-1:] or ["python -m fmus.build failed"]
        raise InputError(reason[0].removeprefix("error: "))
    return done.stdout.splitlines()

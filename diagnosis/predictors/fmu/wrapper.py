"""A foreign FMU with what was found beside it, as one FMU."""

from collections.abc import Mapping, Sequence
from contextlib import closing
from pathlib import Path
from typing import NamedTuple

import numpy as np

import cosim
from cosim.export import export_fmu
from cosim.fmu import FmuModel
from cosim.process import scratch_folder
from cosim.system import prepare
from fmus.addition import ACCELERATION, FORCE, Line
from fmus.build import BuildError, build, native_targets

from ...runs import Column
from ..ship_model import Model
from ..weak_form import WeakWindows, omega
from ..windows import step_of
from .variable_map import DISTURBANCES, VariableMap

FOREIGN, ADDED = "model", "found"  # instances of a container
NONE = "No FMU with the findings is written"
SOURCE = """# What was found beside {name!r}.
from fmus.addition import Line, addition
from fmus.ship import ship
from fmus.ship_description import Description, Part, Value

COMPONENT = addition(ship(description={description!r}), {arguments})
"""


class Wrapped(NamedTuple):
    """An FMU that effects are added to.

    Attributes:
        name: of the file.
        model: the FMU.
        map: which of its variables is which signal, with units.
        lines: see :func:`.variable_map.signal_lines`.
    """

    name: str
    model: FmuModel
    map: VariableMap
    lines: Mapping[str, Mapping[str, Line]]


def write_wrapper(
    path: Path, fmu: Wrapped, start: Model, learned: Model, runs: Sequence[WeakWindows]
) -> tuple[str, VariableMap | None]:
    """Write an FMU of a foreign one and of what was found beside it.

    ``start`` is a model that moves as the foreign one does, ``learned`` the same with what was found.

    Returns:
        What was written, or what is needed for it, in a sentence; the map of the new FMU, or None.
    """
    change = np.concatenate([omega(w, start) - omega(w, learned) for w in runs])
    needed = ~np.isclose(np.abs(change).max(axis=0) / start.ship.scale.forces, 0.0)
    takes = {*fmu.map.stated("inputs"), *fmu.map.stated(DISTURBANCES)}
    takes |= {*FORCE[:2]} if {"tau.force", "tau.angle"} <= takes else set()
    missing = [k for k in np.flatnonzero(needed) if not {FORCE[k], ACCELERATION[k]} & takes]
    if not needed.any():
        return "The findings add nothing to the FMU.", None
    if missing:
        axes = " and ".join(f"{FORCE[k]} or {ACCELERATION[k]}" for k in missing)
        needs = f"{fmu.name} has no input for an additional force or acceleration"
        return f"{NONE}: {needs}; it needs {axes}, which the map names under '{DISTURBANCES}'.", None
    if start.ship.effects.files:
        return f"{NONE}: the ship has effects of your own.", None
    try:
        _write(path, fmu, start, learned, runs)
    except (cosim.InputError, BuildError) as error:
        return f"{NONE}: {error}.", None
    return f"{path.name} is {fmu.name} with the findings.", _map(fmu)


def _write(path: Path, fmu: Wrapped, start: Model, learned: Model, runs: Sequence[WeakWindows]) -> None:
    """Write the two, wired; values pass as they are, for the addition converts them."""
    groups = {group: fmu.map.stated(group) for group in ("outputs", "inputs", DISTURBANCES)}
    lines = {g: {_plain(s): line for s, line in fmu.lines[g].items()} for g in groups}
    stated: dict[str, Line | float] = {**lines["outputs"], **fmu.map.fixed}
    parts = [
        {part: {n: float(x) for n, x in getattr(m, part).items()} for part in ("vessel", "thrusters")}
        for m in (start, learned)
    ]
    arguments = (*parts, stated, lines["inputs"], lines[DISTURBANCES])
    text = ", ".join(map(repr, arguments))
    source = SOURCE.format(name=fmu.name, description=start.ship.description, arguments=text)
    wires = [(f"{FOREIGN}.{c.name}", f"{ADDED}.from_{s}") for s, c in groups["outputs"].items()]
    for group, mark in (("inputs", "to"), (DISTURBANCES, "add")):
        wires += [
            (f"{ADDED}.{mark}_{_plain(s)}", f"{FOREIGN}.{c.name}") for s, c in groups[group].items()
        ]
    h = step_of(runs[0].smoothed)
    stop = round(max(float(w.run.time[-1] - w.run.time[0]) for w in runs) / h) * h
    write_container(path, fmu.model.path, source, wires, (h, stop), _start_values(fmu))


def _plain(signal: str) -> str:
    """A signal's name as that of a variable: ``rudder_delta`` of ``rudder.delta``."""
    return signal.replace(".", "_")


def _start_values(fmu: Wrapped) -> list[str]:
    parameters = (fmu.model.variables[c.name] for c in fmu.map.stated("start").values())
    return [f"{FOREIGN}.{v.name}" for v in parameters if v.causality == "parameter"]


def _map(fmu: Wrapped) -> VariableMap:
    """The map of the container: commands in SI, all else as of the foreign FMU."""

    def inside(columns: Mapping[str, Column]) -> dict[str, Column]:
        return {s: c.model_copy(update={"name": f"{FOREIGN}.{c.name}"}) for s, c in columns.items()}

    exposed = _start_values(fmu)
    start = inside(fmu.map.stated("start"))
    return VariableMap(
        inputs={s: Column(name=f"{ADDED}.{_plain(s)}") for s in fmu.map.stated("inputs")},
        outputs={**inside(fmu.map.stated("outputs")), **fmu.map.fixed},
        start={s: c for s, c in start.items() if c.name in exposed},
        run_in=fmu.map.run_in,
    )


def write_container(
    path: Path,
    foreign: Path,
    source: str,
    wires: Sequence[tuple[str, str]],
    times: tuple[float, float],
    exposed: Sequence[str],
    parameters: Mapping[str, float] | None = None,
) -> None:
    """Write an FMU of two: the foreign one, and a component.

    Args:
        path: of the new FMU.
        foreign: of the foreign one.
        source: Python text of the component.
        wires: pairs of ``INSTANCE.VARIABLE``; values pass as they are.
        times: length of a step, and of a run [s].
        exposed: variables of the foreign one that can be set from outside.
        parameters: variable of the foreign one -> value; None: as it has them.

    Raises:
        InputError: the two do not fit together.
        BuildError: the component cannot be built.
    """
    with scratch_folder() as folder:
        text = folder / f"{ADDED}.py"
        text.write_text(source)
        try:
            (made,) = build(text, folder, native=native_targets())
        except BuildError:  # no compiler
            (made,) = build(text, folder)
        content = {
            "name": "wrapper",
            "step": times[0],
            "stop": times[1],
            "fmus": {
                ADDED: {"path": str(made)},
                FOREIGN: {"path": str(foreign), "parameters": dict(parameters or {})},
            },
            "connections": [*wires],
            "transformations": {target: {"factor": 1.0} for _, target in wires},
        }
        with closing(prepare(cosim.load_scenario(content))) as system:
            export_fmu(system, path, overwrite=True, expose=exposed)

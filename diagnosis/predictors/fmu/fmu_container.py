"""One FMU of a foreign one and of a component that is wired to it."""

from collections.abc import Mapping, Sequence
from contextlib import closing
from pathlib import Path

import cosim
from cosim.export import export_fmu
from cosim.process import scratch_folder
from cosim.system import prepare
from fmus.build import BuildError, build, native_targets

FOREIGN, ADDED = "model", "found"  # instances of the container


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

"""Parameter sets (SSP 1.0) as start values of FMUs: what ``python -m fmus.build --parameters`` reads.

The master has a reader of its own, which this package may not know; this one is FMPy's, with its check
against the schema of the standard.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path
from xml.etree import ElementTree

from cybership.message_text import brief, name_of, quoted

from ..declare import Component, DeclarationError, Variable, nearest, variables

# Entries that belong to the model but that no FMU takes, in the annotation that is ours.
BESIDE = ".//*[@type='cybership.beside']//*[@name]"
# Measured runs with values that hold in them alone; those of the first are parameters as well.
RUNS = ".//*[@type='cybership.run']/*[@name]"


@dataclass(frozen=True)
class StartValues:
    """Start values for components.

    Attributes:
        values: component -> variable -> value and the unit that it claims to have; empty: as declared.
        path: file that they are from.
        beside: what the file holds that is no parameter of an FMU.
        runs: measured runs with values that hold in them alone, such as times of failures.
    """

    values: Mapping[str, Mapping[str, tuple[float, str | None]]] = field(default_factory=dict)
    path: Path = Path()
    beside: Sequence[str] = ()
    runs: Sequence[str] = ()

    def baked(self, component: Component) -> Component:
        """The component with its values as start values.

        Raises:
            DeclarationError: a variable that cannot be set, another unit, or a value out of range.
        """
        given = self.values.get(component.name, {})
        settable = {v.name: v for v in [*variables(component.params), *variables(component.inputs)]}
        for name, (value, unit) in given.items():
            where = f"'{self.path}': {component.name}.{name_of(name)}"
            if name not in settable:
                raise DeclarationError(
                    f"{where} is not a parameter{nearest(name, settable)}; one of an effect of "
                    "your own needs --effects FILE.py"
                )
            _check(value, unit, settable[name], where)
        starts = {name: value for name, (value, _) in given.items() if value != settable[name].start}
        return component.starting(starts)


def read_starts(path: Path) -> StartValues:
    """The values of a parameter set.

    Args:
        path: an SSP 1.0 ``.ssv`` file whose names read ``model.parameter``.

    Raises:
        DeclarationError: missing, not valid by the schema, a name twice, or a value that is no number.
    """
    from fmpy.ssp.ssd import read_ssv

    if not path.is_file():
        raise DeclarationError(f"no such parameter set: '{path}'")
    try:
        content = path.read_bytes()
        entries = read_ssv(BytesIO(content)).parameters
    except Exception as error:  # FMPy raises nothing more special, and begins with a title
        lines = str(error).splitlines() or [repr(error)]
        reason = lines[min(1, len(lines) - 1)]
        raise DeclarationError(f"'{path}' is not an SSP 1.0 parameter set: {brief(reason)}") from None
    found: dict[str, dict[str, tuple[float, str | None]]] = {}
    for entry in entries:
        model, dot, name = str(entry.name).partition(".")
        called = name_of(entry.name)
        if not dot:
            raise DeclarationError(f"'{path}': '{called}' is not of the form model.parameter")
        if name in found.setdefault(model, {}):
            raise DeclarationError(f"'{path}': {called} occurs twice")
        value = float(entry.value) if entry.type in ("Real", "Integer") else math.nan
        if not math.isfinite(value):
            raise DeclarationError(f"'{path}': the value of {called} is not a number")
        found[model][name] = value, entry.unit
    root = ElementTree.fromstring(content)
    notes = [f"{e.get('name')}: {e.get('description')}" for e in root.iterfind(BESIDE)]
    return StartValues(found, path, notes, [e.get("name", "") for e in root.iterfind(RUNS)])


def _check(value: float, unit: str | None, v: Variable, where: str) -> None:
    if unit not in (None, v.unit):
        raise DeclarationError(f"{where} is in {quoted(unit)}, but the FMU's unit is '{v.unit}'")
    if v.range.min is not None and value < v.range.min:
        raise DeclarationError(f"{where} = {value:g} is below its minimum {v.range.min:g}")
    if v.range.max is not None and value > v.range.max:
        raise DeclarationError(f"{where} = {value:g} is above its maximum {v.range.max:g}")

"""Directories of the Open Simulation Platform as scenarios, with the events of their scenario file."""

import json
import re
from collections.abc import Collection
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element

from ..conversion import SAME, conversion
from ..errors import InputError, nearest
from ..fmu.fmu_model import FmuModel
from .documents import file_of, local, need, number, parse, read_file, start_value, variable
from .groups import variables_of_group
from .imported import Imported
from .namespaces import OSP_SCENARIOS, OSP_SPACE, OSP_STRUCTURE

NAMES = {"osp": OSP_SPACE}
# Default of libcosim where the file gives none [s].
DEFAULT_STEP = 0.1

# The two ends of each kind of connection.
ENDS = {
    "VariableConnection": ("Variable", "Variable"),
    "VariableGroupConnection": ("VariableGroup", "VariableGroup"),
    "SignalConnection": ("Variable", "Signal"),
}

# Simulator, and name of a variable or group.
End = tuple[str, str]


def read_osp(path: Path) -> Imported:
    """The system of a directory, or of its OspSystemStructure.xml.

    Raises:
        InputError: no system structure, or it uses a feature that this master lacks.
    """
    file = path / OSP_STRUCTURE if path.is_dir() else path
    if not file.exists():
        raise InputError(f"'{path}' is a folder without {OSP_STRUCTURE}")
    root = parse(read_file(file), file, "OspSystemStructure", OSP_SPACE)
    return _OspReader(file, root).read()


class _OspReader:
    """One pass over a system structure."""

    def __init__(self, file: Path, root: Element) -> None:
        self.file = file
        self.folder = file.parent.resolve()
        self.root = root
        self.notes: list[str] = []
        self.models: dict[str, FmuModel] = {}

    def read(self) -> Imported:
        start = number(self.text("StartTime", "0"), f"'{self.file}': StartTime")
        if start != 0.0:
            raise InputError(f"'{self.file}' starts at {start:g} s, not at 0")
        algorithm = self.text("Algorithm", "fixedStep")
        if algorithm != "fixedStep":
            raise InputError(f"'{self.file}': the algorithm '{algorithm}' is not supported")
        step = self.text("BaseStepSize", "")
        if not step:
            self.notes.append(f"no step is given; libcosim would take {DEFAULT_STEP} s")
        fmus = self.simulators()
        connections, transformations = self.connections()
        content: dict[str, Any] = {
            "name": re.sub(r"[/\\\x00]", "_", self.folder.name) or "system",
            "step": number(step, f"'{self.file}': BaseStepSize") if step else DEFAULT_STEP,
            "algorithm": "jacobi",
            "fmus": fmus,
            "connections": connections,
            "transformations": transformations,
        }
        end = self.text("EndTime", "")
        if end:
            content["stop"] = number(end, f"'{self.file}': EndTime")
        content |= self.scenario()
        self.notes.append("all FMUs step together (jacobi), as in other tools")
        return Imported(content, self.folder, self.notes)

    def text(self, name: str, default: str) -> str:
        return (self.root.findtext(f"osp:{name}", default, NAMES) or default).strip()

    def simulators(self) -> dict[str, dict[str, Any]]:
        """Entries of ``fmus``."""
        fmus: dict[str, dict[str, Any]] = {}
        for simulator in self.root.iterfind("osp:Simulators/osp:Simulator", NAMES):
            name = need(simulator, "name", f"'{self.file}'")
            where = f"'{self.file}': simulator '{name}'"
            if name in fmus:
                raise InputError(f"{where} occurs twice")
            path = self.folder / file_of(need(simulator, "source", where), where)
            fmus[name] = {"path": str(path), "parameters": {}}
            self.models[name] = FmuModel(path)
            if simulator.get("stepSize") is not None:
                fmus[name]["step"] = number(simulator.get("stepSize"), f"{where}: stepSize")
            for entry in simulator.iterfind("osp:InitialValues/osp:InitialValue", NAMES):
                parameter = need(entry, "variable", where)
                if len(entry) != 1:
                    raise InputError(f"{where}: {parameter} needs one value, not {len(entry)}")
                value = start_value(entry[0], f"{where}: {parameter}")
                fmus[name]["parameters"][parameter] = value
        return fmus

    def connections(self) -> tuple[list[list[str]], dict[str, dict[str, float]]]:
        """Connections, and the transformation at each input that has one."""
        found: list[list[str]] = []
        transformations: dict[str, dict[str, float]] = {}
        functions = self.functions()
        into: dict[str, str] = {}
        out_of: list[tuple[str, str]] = []
        for wire in self.root.iterfind("osp:Connections/*", NAMES):
            kind, (first, second) = local(wire), self.ends(wire)
            if kind == "SignalConnection":
                function, signal = self.signal(second, functions)
                name = ".".join(self.end(first))
                if signal == "out":
                    out_of.append((function, name))
                elif into.setdefault(function, name) != name:
                    raise InputError(
                        f"'{self.file}': two variables are connected to the input of the function "
                        f"'{function}'"
                    )
            else:
                pairs = [(self.end(first), self.end(second))]
                if kind == "VariableGroupConnection":
                    pairs = self.grouped(*pairs[0])
                for a, b in pairs:
                    output, target = self.directed(a, b)
                    found.append([output, target])
                    if self.units_differ(a, b):
                        transformations[target] = {"factor": 1.0, "offset": 0.0}
        for function, target in out_of:
            if function not in into:
                raise InputError(
                    f"'{self.file}': the input of the function '{function}' is not connected"
                )
            found.append([into[function], target])
            factor, offset = functions[function]
            transformations[target] = {"factor": factor, "offset": offset}
        return found, transformations

    def ends(self, wire: Element) -> tuple[Element, Element]:
        """The two ends of a connection."""
        kind = local(wire)
        if kind not in ENDS:
            raise InputError(f"'{self.file}': {kind} is not supported")
        ends = sorted(wire, key=local, reverse=True)
        if tuple(local(end) for end in ends) != ENDS[kind]:
            raise InputError(f"'{self.file}': a {kind} needs a {ENDS[kind][0]} and a {ENDS[kind][1]}")
        return ends[0], ends[1]

    def end(self, element: Element) -> tuple[str, str]:
        """Simulator and name of one end of a connection."""
        where = f"'{self.file}': a connection"
        simulator, name = need(element, "simulator", where), need(element, "name", where)
        if local(element) == "Variable":
            variable(self.models, simulator, name, where)
        elif simulator not in self.models:
            raise InputError(f"{where}: there is no '{simulator}'{nearest(simulator, self.models)}")
        return simulator, name

    def signal(self, element: Element, functions: Collection[str]) -> tuple[str, str]:
        """Function and signal of one end of a connection."""
        where = f"'{self.file}': a connection"
        function, name = need(element, "function", where), need(element, "name", where)
        if function not in functions:
            raise InputError(f"'{self.file}': no function '{function}'{nearest(function, functions)}")
        if name not in ("in", "out"):
            raise InputError(f"{where}: '{function}' has no signal '{name}'; there are in, out")
        return function, name

    def units_differ(self, a: End, b: End) -> bool:
        """Whether a scenario would convert units between two ends, which libcosim does not."""
        ends = f"{'.'.join(a)} and {'.'.join(b)}"
        one, other = (self.models[simulator].variables[name].unit for simulator, name in (a, b))
        if conversion(one, other, f"'{self.file}': {ends}") in (None, SAME):
            return False
        names = " and ".join(f"'{unit.name}'" for unit in (one, other) if unit is not None)
        self.notes.append(f"{ends} are in {names}; values pass unchanged, as in libcosim")
        return True

    def functions(self) -> dict[str, tuple[float, float]]:
        """Linear transformations: name -> factor, offset."""
        found: dict[str, tuple[float, float]] = {}
        for function in self.root.iterfind("osp:Functions/*", NAMES):
            name = need(function, "name", f"'{self.file}'")
            where = f"'{self.file}': function '{name}'"
            if local(function) != "LinearTransformation":
                raise InputError(f"{where}: {local(function)} is not supported")
            if name in found:
                raise InputError(f"{where} occurs twice")
            found[name] = (
                number(function.get("factor", "1"), f"{where}: factor"),
                number(function.get("offset", "0"), f"{where}: offset"),
            )
        return found

    def directed(self, a: End, b: End) -> tuple[str, str]:
        """A connection from output to input; the file may have either order."""
        if self.models[a[0]].variables[a[1]].causality == "input":
            a, b = b, a
        return ".".join(a), ".".join(b)

    def grouped(self, a: End, b: End) -> list[tuple[End, End]]:
        """The connections of two variable groups."""
        first, second = self.group(*a), self.group(*b)
        if len(first) != len(second):
            raise InputError(
                f"'{self.file}': the variable groups {'.'.join(a)} and {'.'.join(b)} differ in size: "
                f"{len(first)} and {len(second)}"
            )
        return [((a[0], x), (b[0], y)) for x, y in zip(first, second, strict=True)]

    def group(self, simulator: str, name: str) -> list[str]:
        """The variables of a group, nested groups included."""
        model = self.models[simulator]
        described = f"{model.name}_OspModelDescription.xml"
        for file in (model.path.parent / described, self.folder / described):
            if file.is_file():
                break
        else:
            raise InputError(f"'{self.file}': {simulator}.{name} needs '{described}'")
        found = variables_of_group(file, name)
        for reference in found:
            variable(self.models, simulator, reference, f"'{file}': group '{name}'")
        return found

    def scenario(self) -> dict[str, Any]:
        """Events and end of the scenario file, if there is exactly one."""
        files = sorted((self.folder / OSP_SCENARIOS).glob("*.json"))
        if len(files) > 1:
            names = ", ".join(file.name for file in files)
            self.notes.append(f"only one of several scenarios can be used, so none is: {names}")
        if len(files) != 1:
            return {}
        try:
            content = json.loads(files[0].read_text(encoding="utf-8-sig"))
            defaults = content.get("defaults", {})
            events = [{**defaults, **event} for event in content.get("events", [])]
        except (OSError, ValueError, AttributeError, TypeError, RecursionError) as error:
            raise InputError(f"'{files[0]}' cannot be read as an OSP scenario: {error}") from None
        if events:
            self.notes.append(f"with the events of '{files[0].name}'")
        found = {"events": events, "description": content.get("description", "")}
        return found | ({"stop": content["end"]} if "end" in content else {})

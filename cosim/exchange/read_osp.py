"""Directories of the Open Simulation Platform as scenarios, with the events of their scenario file."""

import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element

from ..errors import InputError, nearest
from ..fmu import Model
from .osp import NAMESPACE, SCENARIOS, STRUCTURE
from .reading import Imported, file_of, local, need, number, parse, start_value

NAMES = {"osp": NAMESPACE}
# What libcosim takes where the file gives none [s].
DEFAULT_STEP = 0.1

Pairs = list[tuple[str, str]]


def read_osp(path: Path) -> Imported:
    """The system of a directory, or of its OspSystemStructure.xml.

    Raises:
        InputError: no system structure, or it has something that this master cannot do.
    """
    file = path / STRUCTURE if path.is_dir() else path
    try:
        text = file.read_bytes()
    except FileNotFoundError:
        raise InputError(f"'{path}' is a folder without {STRUCTURE}") from None
    except OSError as error:
        raise InputError(f"'{file}' cannot be read: {error.strerror}") from None
    root = parse(text, f"'{file}'", "OspSystemStructure", NAMESPACE)
    return _Reader(file, root).read()


class _Reader:
    """One pass over a system structure."""

    def __init__(self, file: Path, root: Element) -> None:
        self.file = file
        self.folder = file.parent.resolve()
        self.root = root
        self.notes: list[str] = []
        self.models: dict[str, Model] = {}

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
        self.notes.append("all FMUs step at once (jacobi), as in other tools")
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
                raise InputError(f"{where} stands there twice")
            path = self.folder / file_of(need(simulator, "source", where), where)
            fmus[name] = {"path": str(path), "parameters": {}}
            self.models[name] = Model(path)
            if simulator.get("stepSize") is not None:
                fmus[name]["step"] = number(simulator.get("stepSize"), f"{where}: stepSize")
            for entry in simulator.iterfind("osp:InitialValues/osp:InitialValue", NAMES):
                variable = need(entry, "variable", where)
                for typed in entry:
                    value = start_value(typed, f"{where}: {variable}")
                    fmus[name]["parameters"][variable] = value
        return fmus

    def end(self, element: Element) -> tuple[str, str]:
        """Simulator and name of one end of a connection."""
        where = f"'{self.file}': a connection"
        simulator, name = need(element, "simulator", where), need(element, "name", where)
        if simulator not in self.models:
            raise InputError(f"{where}: no simulator '{simulator}'{nearest(simulator, self.models)}")
        return simulator, name

    def connections(self) -> tuple[list[list[str]], dict[str, dict[str, float]]]:
        """Connections, and the transformation at each input that has one."""
        found: list[list[str]] = []
        functions = self.functions()
        into: dict[str, str] = {}
        out_of: dict[str, list[str]] = {}
        for wire in self.root.iterfind("osp:Connections/*", NAMES):
            kind = local(wire)
            ends = [child for child in wire if local(child) in ("Variable", "VariableGroup")]
            if kind == "VariableConnection":
                found.append(self.directed(*(self.end(e) for e in ends)))
            elif kind == "VariableGroupConnection":
                first, second = (self.end(e) for e in ends)
                found += [self.directed(a, b) for a, b in self.grouped(first, second)]
            elif kind == "SignalConnection":
                signal = next(child for child in wire if local(child) == "Signal")
                function = need(signal, "function", f"'{self.file}': a connection")
                if function not in functions:
                    raise InputError(
                        f"'{self.file}': no function '{function}'{nearest(function, functions)}"
                    )
                variable = ".".join(self.end(ends[0]))
                if signal.get("name") == "in":
                    into[function] = variable
                else:
                    out_of.setdefault(function, []).append(variable)
            else:
                raise InputError(f"'{self.file}': {kind} is not supported")
        transformations: dict[str, dict[str, float]] = {}
        for function, (factor, offset) in functions.items():
            for target in out_of.get(function, []):
                if function not in into:
                    raise InputError(f"'{self.file}': nothing feeds the function '{function}'")
                found.append([into[function], target])
                transformations[target] = {"factor": factor, "offset": offset}
        return found, transformations

    def functions(self) -> dict[str, tuple[float, float]]:
        """Linear transformations: name -> factor, offset."""
        found: dict[str, tuple[float, float]] = {}
        for function in self.root.iterfind("osp:Functions/*", NAMES):
            name = need(function, "name", f"'{self.file}'")
            where = f"'{self.file}': function '{name}'"
            if local(function) != "LinearTransformation":
                raise InputError(f"{where}: {local(function)} is not supported")
            found[name] = (
                number(function.get("factor", "1"), f"{where}: factor"),
                number(function.get("offset", "0"), f"{where}: offset"),
            )
        return found

    def directed(self, a: tuple[str, str], b: tuple[str, str]) -> list[str]:
        """A connection in the direction in which values go; the file may tell either."""
        known = self.models[a[0]].variables.get(a[1])
        if known is not None and known.causality == "input":
            a, b = b, a
        return [".".join(a), ".".join(b)]

    def grouped(self, a: tuple[str, str], b: tuple[str, str]) -> list[tuple[Any, Any]]:
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
                root = parse(file.read_bytes(), f"'{file}'", "OspModelDescription")
                break
        else:
            raise InputError(f"'{self.file}': {simulator}.{name} needs '{described}'")
        groups = {g.get("name", ""): g for g in _inside(root) if local(g) != "Variable"}
        if name not in groups:
            raise InputError(f"'{file}' has no variable group '{name}'{nearest(name, groups)}")
        return [v.get("ref", "") for v in _inside(groups[name]) if local(v) == "Variable"]

    def scenario(self) -> dict[str, Any]:
        """Events and end of the scenario file, if there is just one."""
        files = sorted((self.folder / SCENARIOS).glob("*.json"))
        if len(files) > 1:
            names = ", ".join(file.name for file in files)
            self.notes.append(f"none of several scenarios is used: {names}")
        if len(files) != 1:
            return {}
        try:
            content = json.loads(files[0].read_text(encoding="utf-8-sig"))
            defaults = content.get("defaults", {})
            events = [{**defaults, **event} for event in content.get("events", [])]
        except (OSError, ValueError, AttributeError, TypeError) as error:
            raise InputError(f"'{files[0]}' cannot be read as an OSP scenario: {error}") from None
        if events:
            self.notes.append(f"with the events of '{files[0].name}'")
        found = {"events": events, "description": content.get("description", "")}
        return found | ({"stop": content["end"]} if "end" in content else {})


def _inside(element: Element) -> Iterator[Element]:
    """All that is inside an element, at any depth."""
    found = element.iter()
    next(found)
    return found

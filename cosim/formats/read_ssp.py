"""SSP 1.0 archives as scenarios: components, connections, parameter sets, steps and the end."""

import re
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element

from cybership.message_text import name_of

from ..conversion import SAME, Conversion, conversion
from ..errors import InputError, nearest
from ..files import file_stems
from ..fmu.archive_check import Archive
from ..fmu.fmu_model import FmuModel, FmuVariable, Value
from .bindings import NAMES, Bindings, BoundValue, file_inside, is_unit_kept, linear
from .documents import need, number, parse, variable
from .imported import Imported, Unpacked
from .namespaces import FMU_TYPE, OSP_ANNOTATION, SSP_SPACES, SSP_STRUCTURE


def read_ssp(path: Path) -> Imported:
    """The system of an archive; its FMUs are unpacked for as long as they are needed.

    Raises:
        InputError: no SSP 1.0 archive, or it uses a feature that this master lacks.
    """
    return _SspReader(Archive(path)).read()


class _SspReader:
    """One pass over an archive."""

    def __init__(self, archive: Archive) -> None:
        self.path = archive.path
        self.archive = archive
        self.unpacked = Unpacked()
        self.notes: list[str] = []
        self.bindings = Bindings(archive, self.notes)
        self.values: dict[str, dict[str, Value]] = {}
        self.models: dict[str, FmuModel] = {}

    def read(self) -> Imported:
        text = self.archive.read(SSP_STRUCTURE)
        root = parse(text, self.path, "SystemStructureDescription", SSP_SPACES["ssd"])
        if (version := root.get("version", "")) not in ("1.0", "1.0.1"):
            raise InputError(f"'{self.path}' is of SSP {name_of(version)}; SSP 1.0 is supported")
        system = root.find("ssd:System", NAMES)
        if system is None:
            raise InputError(f"'{self.path}' has no system")
        fmus = self.components(system)
        for name, given in self.bindings.read(system, f"'{self.path}': the system").items():
            instance, _, parameter = name.partition(".")
            if instance not in fmus:
                raise InputError(
                    f"'{self.path}': a parameter of the system, '{name}', belongs to no component"
                    f"{nearest(instance, fmus)}"
                )
            self.set(instance, parameter, given)
        for name, entry in fmus.items():
            entry["parameters"] = self.values[name]
        connections, transformations = self.connections(system)
        content = {
            "name": re.sub(r"[/\\\x00]", "_", need(root, "name", f"'{self.path}'")) or "system",
            "description": system.get("description", ""),
            "algorithm": "jacobi",
            "fmus": fmus,
            "connections": connections,
            "transformations": transformations,
            **self.experiment(root, system),
        }
        self.notes.append("all FMUs step together (jacobi), as in other tools")
        return Imported(content, self.unpacked.path, self.notes, self.unpacked)

    def components(self, system: Element) -> dict[str, dict[str, Any]]:
        """Entries of ``fmus``; their FMUs are written to the scratch folder."""
        elements = system.findall("ssd:Elements/*", NAMES)
        for element in elements:
            kind = element.tag.removeprefix(f"{{{SSP_SPACES['ssd']}}}")
            if kind != "Component":
                what = {"System": "nested systems", "SignalDictionaryReference": "signal dictionaries"}
                raise InputError(
                    f"'{self.path}': '{element.get('name')}': {what.get(kind, kind)} are not supported"
                )
        if system.find("ssd:SignalDictionaries", NAMES) is not None:
            raise InputError(f"'{self.path}': signal dictionaries are not supported")
        fmus: dict[str, dict[str, Any]] = {}
        names = [need(element, "name", f"'{self.path}'") for element in elements]
        for name, stem, element in zip(names, file_stems(names), elements, strict=True):
            where = f"'{self.path}': component '{name}'"
            if name in fmus:
                raise InputError(f"{where} occurs twice")
            if element.get("type", FMU_TYPE) != FMU_TYPE:
                raise InputError(f"{where}: type '{element.get('type')}' is not supported")
            if element.get("implementation", "any") not in ("any", "CoSimulation"):
                raise InputError(f"{where}: this master runs co-simulation only")
            self.models[name] = self.unpack(need(element, "source", where), f"{stem}.fmu", where)
            fmus[name] = {"path": f"./{stem}.fmu"}
            hint = element.find(f".//ssc:Annotation[@type='{OSP_ANNOTATION}']/osp:StepSizeHint", NAMES)
            if hint is not None:
                fmus[name]["step"] = number(hint.get("value"), f"{where}: StepSizeHint")
            self.values[name] = {}
            for parameter, given in self.bindings.read(element, where).items():
                self.set(name, parameter, given)
        return fmus

    def unpack(self, source: str, file: str, where: str) -> FmuModel:
        """The FMU that a component names, written to the scratch folder."""
        inside = file_inside(source, where)
        path = self.unpacked.path / file
        path.write_bytes(self.archive.read(inside))
        try:
            return FmuModel(path)
        except InputError as error:
            # The user knows the path of the archive, not that of the scratch folder.
            raise InputError(str(error).replace(str(path), f"{self.path}/{inside}")) from None

    def set(self, instance: str, parameter: str, given: BoundValue) -> None:
        """Set a start value; its unit may not differ from the FMU's."""
        known = self.models[instance].variables.get(parameter)
        unit = known.unit if known is not None else None
        if unit is not None and given.unit not in (None, unit.name):
            raise InputError(
                f"{given.where}: {instance}.{parameter} is in '{given.unit}', but the FMU's unit is "
                f"'{unit.name}'"
            )
        self.values[instance][parameter] = given.value

    def connections(self, system: Element) -> tuple[list[list[str]], dict[str, dict[str, float]]]:
        """Connections, and the transformations at inputs besides conversions of units."""
        found: list[list[str]] = []
        transformations: dict[str, dict[str, float]] = {}
        for wire in system.iterfind("ssd:Connections/ssd:Connection", NAMES):
            where = f"'{self.path}': a connection"
            start, end = wire.get("startElement"), wire.get("endElement")
            names = need(wire, "startConnector", where), need(wire, "endConnector", where)
            if start is None or end is None:
                face = names[0] if start is None else names[1]
                self.notes.append(f"'{face}' of the whole system is not connected here")
                continue
            output, target = f"{start}.{names[0]}", f"{end}.{names[1]}"
            where = f"'{self.path}': {output} -> {target}"
            a = variable(self.models, start, names[0], where)
            b = variable(self.models, end, names[1], where)
            found.append([output, target])
            how = linear(wire, where)
            if how is not None or (is_unit_kept(wire) and b.type == "Real"):
                first = SAME if is_unit_kept(wire) else self.conversion(a, b, where)
                then = how or SAME
                transformations[target] = {
                    "factor": then.factor * first.factor,
                    "offset": then.factor * first.offset + then.offset,
                }
        return found, transformations

    def conversion(self, a: FmuVariable, b: FmuVariable, where: str) -> Conversion:
        """The conversion of units that precedes a transformation."""
        how = conversion(a.unit, b.unit, where)
        if how is None:
            self.notes.append(
                f"{where}: the units cannot be compared; only the transformation is applied"
            )
        return how or SAME

    def experiment(self, root: Element, system: Element) -> dict[str, float]:
        """Step and end."""
        found: dict[str, float] = {}
        experiment = root.find("ssd:DefaultExperiment", NAMES)
        if experiment is not None:
            if number(experiment.get("startTime", "0"), "startTime") != 0.0:
                raise InputError(f"'{self.path}' starts at {experiment.get('startTime')} s, not at 0")
            if experiment.get("stopTime") is not None:
                found["stop"] = number(experiment.get("stopTime"), "stopTime")
            steps = experiment.iterfind(
                f".//ssc:Annotation[@type='{OSP_ANNOTATION}']//osp:FixedStepAlgorithm", NAMES
            )
            for algorithm in steps:
                found["step"] = number(algorithm.get("baseStepSize"), "baseStepSize")
        for master in system.iterfind("ssd:SimulationInformation/ssd:FixedStepMaster", NAMES):
            found.setdefault("step", number(master.get("stepSize"), "stepSize"))
        own = (model.suggested_step for model in self.models.values())
        if "step" not in found and (suggested := [step for step in own if step is not None]):
            found["step"] = min(suggested)
            self.notes.append(f"no step is given; the FMUs suggest {min(suggested):g} s")
        return found

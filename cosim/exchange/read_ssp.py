"""SSP 1.0 archives as scenarios: components, connections, parameter sets, steps and the end."""

import re
import zipfile
from pathlib import Path, PurePosixPath
from typing import Any
from xml.etree.ElementTree import Element

from ..archive import check_archive
from ..errors import InputError, nearest
from ..fmu import Model
from .portable import file_stems
from .reading import Imported, Unpacked, file_of, need, number, parse, start_value
from .ssp import OSP_ANNOTATION, SPACES, STRUCTURE

FMU_TYPE = "application/x-fmu-sharedlibrary"
SET_TYPE = "application/x-ssp-parameter-set"
MAPPINGS = "http://ssp-standard.org/SSP1/SystemStructureParameterMapping"
NAMES = {**SPACES, "ssm": MAPPINGS}
# An FMU of a gigabyte is one that somebody means to fill a disk with.
LARGEST = 2**30

Values = dict[str, Any]


def read_ssp(path: Path) -> Imported:
    """The system of an archive; its FMUs are unpacked for as long as they are needed.

    Raises:
        InputError: no SSP 1.0 archive, or it has something that this master cannot do.
    """
    check_archive(path)
    try:
        with zipfile.ZipFile(path) as archive:
            return _Reader(path, archive).read()
    except (OSError, zipfile.BadZipFile, NotImplementedError, RuntimeError) as error:
        raise InputError(f"'{path}' cannot be read as an SSP archive: {error}") from None


class _Reader:
    """One pass over an archive."""

    def __init__(self, path: Path, archive: zipfile.ZipFile) -> None:
        self.path = path
        self.archive = archive
        self.unpacked = Unpacked()
        self.notes: list[str] = []
        self.values: dict[str, Values] = {}
        self.models: dict[str, Model] = {}

    def read(self) -> Imported:
        root = parse(self.file(STRUCTURE), f"'{self.path}'", "SystemStructureDescription", SPACES["ssd"])
        if root.get("version") not in ("1.0", "1.0.1"):
            raise InputError(f"'{self.path}' is of SSP {root.get('version')}; this reader knows 1.0")
        system = root.find("ssd:System", NAMES)
        if system is None:
            raise InputError(f"'{self.path}' has no system")
        fmus = self.components(system)
        for binding in system.iterfind("ssd:ParameterBindings/ssd:ParameterBinding", NAMES):
            for name, value in self.binding(binding, "the system").items():
                instance, _, parameter = name.partition(".")
                if instance not in fmus:
                    raise InputError(
                        f"'{self.path}': a parameter of the system, '{name}', belongs to no component"
                        f"{nearest(instance, fmus)}"
                    )
                self.values[instance][parameter] = value
        for name, entry in fmus.items():
            entry["parameters"] = self.values[name]
        connections, transformations = self.connections(system, fmus)
        content = {
            "name": re.sub(r"[/\\\x00]", "_", need(root, "name", f"'{self.path}'")) or "system",
            "description": system.get("description", ""),
            "algorithm": "jacobi",
            "fmus": fmus,
            "connections": connections,
            "transformations": transformations,
            **self.experiment(root, system),
        }
        self.notes.append("all FMUs step at once (jacobi), as in other tools")
        return Imported(content, self.unpacked.path, self.notes, self.unpacked)

    def file(self, name: str) -> bytes:
        """What a file of the archive holds."""
        if name not in self.archive.namelist():
            raise InputError(f"'{self.path}' has no '{name}'{nearest(name, self.archive.namelist())}")
        if self.archive.getinfo(name).file_size > LARGEST:
            raise InputError(f"'{self.path}': '{name}' is larger than {LARGEST // 2**30} GiB")
        return self.archive.read(name)

    def components(self, system: Element) -> dict[str, dict[str, Any]]:
        """Entries of ``fmus``; their FMUs are written to the scratch folder."""
        elements = list(system.find("ssd:Elements", NAMES) or ())
        for element in elements:
            kind = element.tag.removeprefix(f"{{{SPACES['ssd']}}}")
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
                raise InputError(f"{where} stands there twice")
            if element.get("type", FMU_TYPE) != FMU_TYPE:
                raise InputError(f"{where}: type '{element.get('type')}' is not supported")
            if element.get("implementation", "any") not in ("any", "CoSimulation"):
                raise InputError(f"{where}: this master runs co-simulation only")
            source = str(PurePosixPath(file_of(need(element, "source", where), where)))
            (self.unpacked.path / f"{stem}.fmu").write_bytes(self.file(source))
            fmus[name] = {"path": f"./{stem}.fmu"}
            hint = element.find(f".//ssc:Annotation[@type='{OSP_ANNOTATION}']/osp:StepSizeHint", NAMES)
            if hint is not None:
                fmus[name]["step"] = number(hint.get("value"), f"{where}: StepSizeHint")
            self.models[name] = Model(self.unpacked.path / f"{stem}.fmu")
            self.values[name] = {}
            for binding in element.iterfind("ssd:ParameterBindings/ssd:ParameterBinding", NAMES):
                self.values[name] |= self.binding(binding, where, name)
        return fmus

    def binding(self, binding: Element, where: str, component: str = "") -> Values:
        """Parameter -> value of one binding, of a component or of the system."""
        if binding.get("type", SET_TYPE) != SET_TYPE or binding.get("sourceBase", "SSD") != "SSD":
            raise InputError(f"{where}: this kind of parameter binding is not supported")
        source = binding.get("source")
        if source is not None:
            file = str(PurePosixPath(file_of(source, where)))
            root = parse(self.file(file), f"'{file}'", "ParameterSet", SPACES["ssv"])
        else:
            root = binding.find("ssd:ParameterValues/ssv:ParameterSet", NAMES)
            if root is None:
                raise InputError(f"{where}: a parameter binding without values")
        prefix = binding.get("prefix", "")
        values: Values = {}
        for entry in root.iterfind("ssv:Parameters/ssv:Parameter", NAMES):
            name = prefix + need(entry, "name", where)
            typed = next(iter(entry), None)
            if typed is None:
                raise InputError(f"{where}: the parameter '{name}' has no value")
            values[name] = start_value(typed, f"{where}: {name}")
            self.check_unit(typed.get("unit"), f"{component}.{name}" if component else name, where)
        mapping = binding.find("ssd:ParameterMapping", NAMES)
        return values if mapping is None else self.mapped(mapping, values, where)

    def check_unit(self, unit: str | None, name: str, where: str) -> None:
        """A value may not claim another unit than the FMU's."""
        component, _, parameter = name.partition(".")
        if unit is None or component not in self.models:
            return
        variable = self.models[component].variables.get(parameter)
        if variable is not None and variable.unit is not None and variable.unit.name != unit:
            raise InputError(
                f"{where}: {name} is in '{unit}', but the FMU's unit is '{variable.unit.name}'"
            )

    def mapped(self, mapping: Element, values: Values, where: str) -> Values:
        """Values under the names, and in the scale, that a mapping gives them."""
        source = mapping.get("source")
        root = mapping.find("ssm:ParameterMapping", NAMES)
        if source is not None:
            file = str(PurePosixPath(file_of(source, where)))
            root = parse(self.file(file), f"'{file}'", "ParameterMapping", MAPPINGS)
        found: Values = {}
        for entry in () if root is None else root.iterfind("ssm:MappingEntry", NAMES):
            name, target = need(entry, "source", where), need(entry, "target", where)
            if name not in values:
                continue
            found[target] = values[name]
            for transformation in entry:
                factor, offset = self.linear(transformation, f"{where}: mapping of '{name}'")
                found[target] = factor * values[name] + offset
        return found

    def linear(self, element: Element, where: str) -> tuple[float, float]:
        """Factor and offset of a transformation."""
        if element.tag != f"{{{SPACES['ssc']}}}LinearTransformation":
            kind = element.tag.rpartition("}")[2]
            raise InputError(f"{where}: {kind} is not supported")
        factor, offset = element.get("factor", "1"), element.get("offset", "0")
        return number(factor, f"{where}: factor"), number(offset, f"{where}: offset")

    def connections(
        self, system: Element, fmus: dict[str, Any]
    ) -> tuple[list[list[str]], dict[str, dict[str, float]]]:
        """Connections, and the transformation at each input that has one."""
        found: list[list[str]] = []
        transformations: dict[str, dict[str, float]] = {}
        for wire in system.iterfind("ssd:Connections/ssd:Connection", NAMES):
            where = f"'{self.path}': a connection"
            start, end = wire.get("startElement"), wire.get("endElement")
            output = f"{start}.{need(wire, 'startConnector', where)}"
            target = f"{end}.{need(wire, 'endConnector', where)}"
            if start is None or end is None:
                face = (output if start is None else target).partition(".")[2]
                self.notes.append(f"'{face}' of the whole system is connected to nothing here")
                continue
            for element in (start, end):
                if element not in fmus:
                    raise InputError(f"{where}: no component '{element}'{nearest(element, fmus)}")
            where = f"'{self.path}': {output} -> {target}"
            if wire.get("suppressUnitConversion") in ("true", "1"):
                raise InputError(f"{where}: suppressUnitConversion is not supported")
            found.append([output, target])
            for child in wire:
                if child.tag.startswith(f"{{{SPACES['ssc']}}}"):
                    factor, offset = self.linear(child, where)
                    transformations[target] = {"factor": factor, "offset": offset}
        return found, transformations

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
        if "step" not in found:
            experiments = [model.description.defaultExperiment for model in self.models.values()]
            steps = [float(e.stepSize) for e in experiments if e is not None and e.stepSize]
            if steps:
                found["step"] = min(steps)
                self.notes.append(f"no step is given; the FMUs themselves suggest {min(steps):g} s")
        return found

"""An FMI 2.0 co-simulation FMU: its archive and its description."""

import copy
import hashlib
import io
import math
import os
import sys
import zipfile
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from xml.etree import ElementTree

import fmpy
from fmpy.model_description import ModelDescription, read_model_description

from cybership.scratch_folder import Scratch

from ..conversion import BASE_UNITS, Unit
from ..errors import InputError, nearest
from . import archive_check

DESCRIPTION = "modelDescription.xml"
NUMERIC = ("Real", "Integer", "Boolean", "Enumeration")
# What only the library of pythonfmu exports.
PYTHON_SYMBOL = "finalizePythonInterpreter"
# fmi2Integer has 32 bits.
INT_LIMIT = 2**31

# What a variable can be set to.
Value = bool | int | float | str


def _annotations(xml: bytes) -> ElementTree.Element | None:
    """What tools have added to a model description; they stand before its variables."""
    if b"VendorAnnotations" in xml:
        for _, element in ElementTree.iterparse(io.BytesIO(xml)):
            if element.tag == "VendorAnnotations":
                return element
    return None


@dataclass(frozen=True)
class FmuVariable:
    """A variable of an FMU.

    Attributes:
        name, description, causality, variability: as in the model description.
        type: ``Real``, ``Integer``, ``Boolean``, ``Enumeration`` or ``String``.
        reference: value reference.
        unit: None where the description has none.
        min, max: limits [unit]; None where there are none.
        start: start value as written; None where there is none.
    """

    name: str
    type: str
    reference: int
    causality: str
    variability: str
    unit: Unit | None
    description: str
    min: float | None
    max: float | None
    start: str | None


class FmuModel:
    """An FMU file, checked and described.

    Args:
        path: the ``.fmu`` file.
        folder: where it is unpacked already, and removed by the caller.

    Attributes:
        alone: whether the process runs no other FMU: then modules of a Python FMU may be imported at
            any call, else only while it is instantiated.

    Raises:
        InputError: not there, not an FMU, or not one for FMI 2.0 co-simulation.
    """

    def __init__(self, path: Path, folder: Path | None = None) -> None:
        self.path = path
        if not os.path.isfile(path):  # Path.is_file raises for names that are too long
            near = (p.name for p in path.parent.glob("*.fmu"))
            hint = nearest(path.name, near) or "; 'cybership build NAME --out DIR' writes one"
            raise InputError(f"no such FMU: '{path}'{hint}")
        entries = {entry.filename for entry in archive_check.check_archive(path)}
        if DESCRIPTION not in entries:
            raise InputError(f"'{path}' is not an FMU: it has no {DESCRIPTION}")
        try:
            with zipfile.ZipFile(path) as opened:
                xml = opened.read(DESCRIPTION)
            archive_check.check_xml(xml, path, "an FMU")
            _, root = next(ElementTree.iterparse(io.BytesIO(xml), ["start"]))
            version = root.get("fmiVersion")
            if version != "2.0":
                raise InputError(f"'{path}' is for FMI {version}; this master runs FMI 2.0")
            self.annotations = _annotations(xml)
            self.description: ModelDescription = read_model_description(str(path), validate=False)
        except InputError:
            raise
        except Exception as error:
            raise InputError(f"'{path}' cannot be read as an FMU: {error}") from error
        if self.description.coSimulation is None:
            raise InputError(f"'{path}' is for model exchange only; this master runs co-simulation")
        library = self.description.coSimulation.modelIdentifier
        if not library or any(c in "/\\:" or not c.isprintable() for c in library):
            raise InputError(
                f"'{path}' is refused: its modelIdentifier {library!r} is not an identifier"
            )
        self.name: str = self.description.modelName or path.stem
        try:
            self.variables = self._read_variables()
        except Exception as error:
            raise InputError(f"'{path}' cannot be read as an FMU: {error}") from error
        self.sha256 = hashlib.sha256(path.read_bytes()).hexdigest()
        self.alone = False
        self._folder = folder
        self._scratch: Scratch | None = None

    def copied_to(self, path: Path) -> "FmuModel":
        """The same FMU in a copy of its file, which need not be read again."""
        model = copy.copy(self)
        model.path, model._folder, model._scratch = path, None, None
        return model

    def _read_variables(self) -> dict[str, FmuVariable]:
        """All variables by name, in the order of the description."""
        units = {
            u.name: Unit(str(u.name))
            if (b := u.baseUnit) is None
            else Unit(
                str(u.name), tuple(getattr(b, n) for n in BASE_UNITS), b.factor or math.nan, b.offset
            )
            for u in self.description.unitDefinitions
        }
        found: dict[str, FmuVariable] = {}
        for v in self.description.modelVariables:
            declared = v.declaredType
            unit = v.unit or (declared.unit if declared is not None else None)
            low, high = v.min, v.max
            if declared is not None:
                low = declared.min if low is None else low
                high = declared.max if high is None else high
            if v.name in found:
                raise ValueError(f"two variables are called '{v.name}'")
            found[v.name] = FmuVariable(
                v.name,
                v.type,
                int(v.valueReference),
                v.causality or "local",
                v.variability or "continuous",
                None if not unit else units.get(unit, Unit(unit)),
                v.description or "",
                None if low is None else float(low),
                None if high is None else float(high),
                v.start,
            )
        return found

    @cached_property
    def exact(self) -> frozenset[str]:
        """Local variables and outputs that begin with their start value: states to be set (2.2.7)."""
        listed = self.description.modelVariables
        exact = (v for v in listed if v.initial == "exact" and v.variability != "constant")
        return frozenset(v.name for v in exact if (v.causality or "local") in ("local", "output"))

    def can_be_set(self, variable: FmuVariable) -> bool:
        """Whether a variable takes a value before the simulation."""
        return variable.causality in ("parameter", "input") or variable.name in self.exact

    @cached_property
    def feedthrough(self) -> dict[str, list[str]]:
        """Input -> outputs that depend on it at the same instant; all where the FMU lists none."""
        inputs = [v.name for v in self.variables.values() if v.causality == "input"]
        feeds: dict[str, list[str]] = {name: [] for name in inputs}
        listed: dict[str, list[str]] = {}
        for unknown in self.description.outputs:
            if unknown.variable is None:
                continue
            known = unknown.dependencies
            listed[unknown.variable.name] = inputs if known is None else [k.name for k in known]
        for v in self.variables.values():
            if v.causality == "output":
                for name in listed.get(v.name, inputs):
                    if name in feeds:
                        feeds[name].append(v.name)
        return feeds

    @cached_property
    def is_native(self) -> bool:
        """Whether the library for this platform is machine code, no way into Python like pythonfmu's."""
        co_simulation = self.description.coSimulation
        assert co_simulation is not None
        library = f"{co_simulation.modelIdentifier}{fmpy.sharedLibraryExtension}"
        try:
            with zipfile.ZipFile(self.path) as archive:
                content = archive.read(f"binaries/{fmpy.platform}/{library}")
        except (
            OSError,
            KeyError,
            zipfile.BadZipFile,
        ):  # gone, or the library is elsewhere in it
            return False
        return PYTHON_SYMBOL.encode() not in content

    def reals(self, *causality: str) -> list[FmuVariable]:
        """Its real variables, those of some causalities or all."""
        every = (v for v in self.variables.values() if v.type == "Real")
        return [v for v in every if not causality or v.causality in causality]

    @property
    def suggested_step(self) -> float | None:
        """Step of its default experiment [s]; None: it suggests none."""
        stated = self.description.defaultExperiment
        return float(stated.stepSize) if stated is not None and stated.stepSize else None

    @property
    def needs_tool(self) -> bool:
        """Whether it needs the tool that it was made with (``needsExecutionTool``)."""
        stated = self.description.coSimulation
        return bool(stated is not None and stated.needsExecutionTool)

    def unpack(self) -> Path:
        """Folder with the unpacked archive; made at the first call."""
        if self._folder is None:
            self._scratch = Scratch()
            self._folder = self._scratch.path
            try:
                archive_check.unpack(self.path, self._folder)
            except BaseException:
                self.close()
                raise
        return self._folder

    def forget_modules(self) -> None:
        """Remove this FMU's modules, so that the next Python FMU imports its own of the same names."""
        folder = str(self._folder)
        for name, module in list(sys.modules.items()):
            if (getattr(module, "__file__", None) or "").startswith(folder):
                del sys.modules[name]
        sys.path[:] = [entry for entry in sys.path if not entry.startswith(folder)]
        for entry in [entry for entry in sys.path_importer_cache if entry.startswith(folder)]:
            del sys.path_importer_cache[entry]

    def close(self) -> None:
        """Remove the unpacked archive."""
        if self._folder is not None:
            self.forget_modules()
            if self._scratch is not None:
                self._scratch.remove()
            self._folder = self._scratch = None

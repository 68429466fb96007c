"""OSP-IS model descriptions: which variables of an FMU form a vector, and of which quantity.

A variable's unit gives its quantity, the first or last part of its name the axis: ``x_hat``, ``y_hat``
in m become the group ``linear_displacement_hat``. Variables whose names give no axis are in no group.
"""

from dataclasses import dataclass
from pathlib import Path
from xml.etree.ElementTree import Element, SubElement

from ..errors import InputError, nearest
from ..fmu.fmu_model import FmuModel, FmuVariable
from .documents import local, parse, read_file
from .namespaces import OSP_MODELS


@dataclass(frozen=True)
class Quantity:
    """A kind of variable group.

    Attributes:
        tag: as OSP-IS calls it.
        word: how names of groups begin.
        unit: SI exponents of kg, m, s and rad; exponents of rad count for angles only.
        axes: the names of its axes, in the order x, y, z.
    """

    tag: str
    word: str
    unit: tuple[int, int, int, int]
    axes: tuple[str, ...]


# In the order of the schema.
QUANTITIES = (
    Quantity("Force", "force", (1, 1, -2, 0), ("XYZ",)),
    Quantity("Torque", "torque", (1, 2, -2, 0), ("KMN",)),
    Quantity("LinearVelocity", "linear_velocity", (0, 1, -1, 0), ("uvw", "xyz")),
    Quantity("AngularVelocity", "angular_velocity", (0, 0, -1, 1), ("pqr", "φθψ")),
    Quantity("LinearDisplacement", "linear_displacement", (0, 1, 0, 0), ("xyz",)),
    Quantity("AngularDisplacement", "angular_displacement", (0, 0, 0, 1), ("φθψ",)),
    Quantity("LinearAcceleration", "linear_acceleration", (0, 1, -2, 0), ("uvw", "xyz")),
    Quantity("AngularAcceleration", "angular_acceleration", (0, 0, -2, 1), ("pqr", "φθψ")),
)
GREEK = {"phi": "φ", "theta": "θ", "psi": "ψ"}


def variable_groups(model: FmuModel) -> dict[str, tuple[Quantity, list[str]]]:
    """Groups of inputs and outputs: name -> quantity, and the variables along x, y, z.

    A name that inputs and outputs share ends in ``_in`` or ``_out``.
    """
    units = _units(model)
    found: dict[tuple[str, str], tuple[Quantity, dict[int, str]]] = {}
    for v in model.variables.values():
        if v.causality not in ("input", "output") or v.type != "Real" or v.unit is None:
            continue
        for quantity in QUANTITIES:
            place = _place(v, quantity) if units.get(v.unit.name) == quantity.unit else None
            if place is not None:
                axis, rest = place
                name = "_".join([quantity.word, *rest[rest[:1] == [quantity.word] :]])
                found.setdefault((name, v.causality), (quantity, {}))[1].setdefault(axis, v.name)
    groups: dict[str, tuple[Quantity, list[str]]] = {}
    for (name, causality), (quantity, along) in found.items():
        shared = (name, "input") in found and (name, "output") in found
        full = f"{name}_{causality.removesuffix('put')}" if shared else name
        groups[full] = (quantity, [along[axis] for axis in sorted(along)])
    return groups


def _units(model: FmuModel) -> dict[str, tuple[int, int, int, int]]:
    """SI exponents of the FMU's units that need no factor, by name."""
    found: dict[str, tuple[int, int, int, int]] = {}
    for unit in model.description.unitDefinitions:
        b = unit.baseUnit
        if b is not None and not any((b.A, b.K, b.mol, b.cd)) and (b.factor, b.offset) == (1.0, 0.0):
            found[str(unit.name)] = (b.kg, b.m, b.s, b.rad)
    return found


def _place(v: FmuVariable, quantity: Quantity) -> tuple[int, list[str]] | None:
    """Which axis a variable lies along (0, 1, 2), and the other parts of its name."""
    parts = v.name.split("_")
    for part, rest in ((parts[0], parts[1:]), (parts[-1], parts[:-1])):
        letter = GREEK.get(part, part)
        for axes in quantity.axes:
            if len(letter) == 1 and letter in axes:
                return axes.index(letter), rest
    return None


def osp_model_description(model: FmuModel) -> Element | None:
    """``<modelName>_OspModelDescription.xml``, or None where the FMU has no groups."""
    groups = variable_groups(model)
    if not groups:
        return None
    root = Element("OspModelDescription", xmlns=OSP_MODELS, version="1.0")
    listed = SubElement(root, "VariableGroups")
    for quantity in QUANTITIES:
        for name, (kind, variables) in groups.items():
            if kind is quantity:
                group = SubElement(listed, quantity.tag, name=name)
                for variable in variables:
                    unit = model.variables[variable].unit
                    SubElement(group, "Variable", ref=variable, unit=unit.name if unit else "")
    return root


def variables_of_group(file: Path, name: str) -> list[str]:
    """The variables of a group in an OSP-IS model description, nested groups included.

    Raises:
        InputError: no model description, or it has no such group.
    """
    root = parse(read_file(file), file, "OspModelDescription")
    groups = {g.get("name", ""): g for g in root.iter() if g is not root and local(g) != "Variable"}
    if name not in groups:
        raise InputError(f"'{file}' has no variable group '{name}'{nearest(name, groups)}")
    return [v.get("ref", "") for v in groups[name].iter() if local(v) == "Variable"]

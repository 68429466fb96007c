"""Reads the description of a ship: a TOML file, checked as a whole before anything is made of it."""

import keyword
import warnings
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Annotated, Any

from pydantic import (
    BaseModel,
    ConfigDict,
    Field,
    TypeAdapter,
    ValidationError,
    field_validator,
)

from cybership.message_text import Location, brief, quoted
from cybership.model_fault import first_fault
from cybership.renamed import with_new_names

from .. import installed
from ..actuators import actuation as actuation  # registers the laws
from ..actuators.law import Law
from ..declare import DeclarationError, Range, Variable, nearest, parameters_of, variables
from ..effects import STANDARD
from ..effects.all_thrusters import LONGEST
from ..hull import Inertia, described_mass, term_variable
from ..hull_functions import FUNCTIONS
from ..scale import REFERENCE_LENGTH, Scale
from ..ship_description import Description, Part, Value
from .numbers_told import Finite, Given, Number, Prime, StrictTable, Term, Text, valued
from .ship_doubts import doubts, line_of
from .ship_warning import ShipWarning
from .wind import by_regression, described_numbers

FOLDERS = (Path(__file__).parents[2] / "ships", Path(__file__).parents[1] / "shipped")
MOST_BYTES = 1_000_000  # of a file; a ship has some hundred numbers
NAME = r"^[a-z][a-z0-9_]*$"
VARIABLE = r"^[A-Za-z][A-Za-z0-9_]*$"
REQUIRED = ("m", "I_z")  # of the inertia; what else is not named is zero

# Of a force that is given, over the cube of the length [N/m3]; chosen: a tenth of the weight of so much
# water, which no thruster reaches.
LARGEST_GIVEN = 1e3


class HullTable(StrictTable):
    """What the water does to the hull."""

    terms: list[Term] = Field(default=[])
    functions: dict[str, dict[str, Given]] = Field(default={})


class ActuatorTable(BaseModel):
    """An actuator: its name, law and title, and the numbers of its law."""

    model_config = ConfigDict(extra="allow")

    name: Annotated[str, Field(pattern=NAME, max_length=30)]
    law: str
    title: Annotated[Text, Field(max_length=60)] = ""
    label: Annotated[Text, Field(max_length=60)] = ""
    command_group: Annotated[str, Field(pattern=NAME, max_length=30)] | None = None
    upstream_propeller: str = ""


class WindTable(BaseModel):
    """What the wind acts on: areas and drag, or areas and superstructure for Fujiwara's regression."""

    model_config = ConfigDict(extra="allow")

    measured: Annotated[bool, Field(strict=True)] = Field(
        False, description="whether the wind over time is an input of the vessel and of predictions"
    )


class PrimeTable(StrictTable):
    """What numbers in prime units are over."""

    water_density: Annotated[Finite, Field(gt=0.0, description="rho [kg/m3]")]
    draft: Annotated[Finite, Field(gt=0.0, description="d [m]; a mass is over rho L^2 d / 2")]


class ShipTable(StrictTable):
    """The description of a ship."""

    name: Annotated[str, Field(pattern=NAME, max_length=40)]
    title: Annotated[Text, Field(min_length=1, max_length=100)]
    source: Text = ""
    length: Annotated[Finite, Field(gt=0.01, lt=1000.0, description="L_pp [m]")]
    beam: Annotated[Finite, Field(gt=0.001, lt=200.0, description="[m]")]
    draft: Annotated[Finite, Field(gt=0.0, lt=100.0)] | None = Field(
        None, description="[m], of the box that the mass is compared with"
    )
    outline: list[tuple[Finite, Finite]] = Field(
        [], description="corners of the waterline, forward and to starboard of the origin [m, m]"
    )
    thrust_allocation: Annotated[bool, Field(strict=True)] = Field(
        True, description="false: commands are the inputs of the thrusters; true: a force is"
    )
    inertia: dict[str, Given] = Field(json_schema_extra={"required": list(REQUIRED)})
    prime: PrimeTable | None = None
    wind: WindTable | None = None
    hull: HullTable = HullTable()
    actuators: list[ActuatorTable] = Field(
        [],
        description="default: two commanded forces, a quarter of the length fore and aft",
    )
    effects: list[str] = Field(
        [],
        description="effects of its actuators, in their order (all possible ones)",
    )
    aliases: dict[str, Annotated[str, Field(pattern=VARIABLE, max_length=60)]] = Field(
        {},
        description="variable of an actuator, or the beginning of its name -> new name",
    )

    @field_validator("aliases")
    @classmethod
    def _are_unique(cls, aliases: dict[str, str]) -> dict[str, str]:
        first: dict[str, str] = {}
        for name, new in aliases.items():
            if (other := first.setdefault(new, name)) != name:
                raise ValueError(f"{other} and {name} are both {quoted(new)}")
        return aliases


def json_schema() -> dict[str, Any]:
    """The schema of a ship's description (JSON Schema)."""
    return ShipTable.model_json_schema()


def shipped_ships() -> list[str]:
    """The names of the shipped ships, and of those of installed packages."""
    shipped = {path.stem for folder in FOLDERS for path in folder.glob("*.toml")}
    return sorted(shipped.union(installed.names(installed.SHIPS)))


def find_ship(name: str | Path) -> Path:
    """The file of a ship: a path, or the name of a shipped one, or of one of an installed package.

    Raises:
        DeclarationError: there is none.
    """
    path = Path(name)
    if path.suffix == ".toml":
        if not path.is_file():
            hint = nearest(path.name, [p.name for p in path.parent.glob("*.toml")])
            raise DeclarationError(f"no such ship file: '{path}'{hint}")
        return path
    for folder in FOLDERS:
        if (folder / f"{name}.toml").is_file() and Path(str(name)).name == str(name):
            return folder / f"{name}.toml"
    if (found := installed.ship_file(str(name))) is not None:
        return found
    known = shipped_ships()
    there = f"there are {', '.join(known)}, or " if known else ""
    hint = nearest(str(name), known) or f"; {there}give a .toml file"
    raise DeclarationError(f"no ship '{name}'{hint}")


def read_ship(name: str | Path) -> Description:
    """The description of a ship.

    Args:
        name: of a shipped ship, or the path of a ``.toml`` file.

    Raises:
        DeclarationError: no such ship, or the file is not as it should be.
    """
    path = find_ship(name).resolve()
    return _read(path, path.stat().st_mtime_ns)


@cache
def _read(path: Path, _changed: int) -> Description:
    if path.stat().st_size > MOST_BYTES:
        raise DeclarationError(f"'{path}' is too large for a ship file")
    try:
        table = ShipTable.model_validate(with_new_names(_toml(path), "ship", path))
    except ValidationError as error:
        raise DeclarationError(f"'{path}': {first_fault(error, ShipTable, _name_fault)}") from None
    except ValueError as error:
        raise DeclarationError(f"'{path}': {brief(str(error))}") from None
    try:
        found = _description(table)
    except DeclarationError as error:
        raise DeclarationError(f"'{path}': {brief(str(error))}") from None
    _warn(path, found, table.draft or (table.prime and table.prime.draft))
    return found


def _name_fault(kind: str, at: Location, value: object) -> str:
    """What a name needs that does not have it; empty: it is another fault."""
    letters = "letters" if at and at[0] == "aliases" else "small letters"
    needs = f"needs {letters}, digits and underscores, a letter first"
    return f"{needs}; got {quoted(value)}" if kind == "string_pattern_mismatch" else ""


def _warn(path: Path, ship: Description, draft: float | None) -> None:
    """Warn of each number that no ship has, with its line."""
    for doubt in doubts(ship, draft):
        line = line_of(doubt, path.read_text(encoding="utf-8"))
        where = f"'{path}'" if line is None else f"'{path}', line {line}"
        warnings.warn(ShipWarning(f"{where}: {doubt.text}"), stacklevel=2)


def _toml(path: Path) -> Any:
    import sys

    if sys.version_info >= (3, 11):
        import tomllib
    else:
        import tomli as tomllib  # pyright: ignore[reportMissingImports]
    try:
        return tomllib.loads(path.read_text(encoding="utf-8-sig"))
    except (ValueError, RecursionError, OSError) as error:  # ValueError also of a number of 5,000 digits
        raise DeclarationError(f"'{path}' cannot be read as TOML: {brief(str(error))}") from None


def _description(table: ShipTable) -> Description:
    prime, L = None, table.length
    if table.prime is not None:
        prime = Prime(L, 0.5 * table.prime.water_density * L * L * table.prime.draft)
    actuators = tuple(
        _actuator(a, Scale(L / REFERENCE_LENGTH), prime) for a in table.actuators or _given_forces(L)
    )
    _once([a.name for a in actuators], "actuators")
    _belong_together(actuators, table.thrust_allocation)
    if any(a.number("half_spacing") for a in actuators) and not table.effects:
        raise DeclarationError("effects: a ship with two units abreast names those of its actuators")
    terms = tuple(t.named(t.name, term_variable(t.name).unit, prime) for t in table.hull.terms)
    _once([t.name for t in terms], "hull.terms")
    return Description(
        table.name,
        table.title,
        table.source,
        table.length,
        table.beam,
        tuple(table.outline) or _box(table.length, table.beam),
        _inertia(table.inertia, prime),
        terms,
        tuple(_function(name, given, prime) for name, given in table.hull.functions.items()),
        actuators,
        table.thrust_allocation,
        () if table.wind is None else _wind(table.wind, prime),
        tuple(table.effects),
        tuple(table.aliases.items()),
        table.wind is not None and table.wind.measured,
    )


def _wind(table: WindTable, prime: Prime | None) -> tuple[Value, ...]:
    """Numbers of what is above the water.

    Raises:
        DeclarationError: one is unknown, out of its range, or missing for the regression.
    """
    given = {name: _checked("wind", name, x) for name, x in (table.model_extra or {}).items()}
    declared = described_numbers(given)
    missing = [v.name for v in declared if v.name not in given and v.name != "air_density"]
    if by_regression(given) and missing:
        raise DeclarationError(f"wind: {missing[0]} is missing; a superstructure needs it")
    if table.measured and not given:
        raise DeclarationError("wind: frontal_area is missing; a measured wind needs it")
    return _values("wind", given, declared, prime)


def _given_forces(L: float) -> list[ActuatorTable]:
    """What pushes a ship without actuators: two forces as they are commanded, which make any moment."""
    largest = LARGEST_GIVEN * L**3
    force = {"law": "given_force", "F_X": largest, "F_Y": largest}
    places = {"fore": 0.25 * L, "aft": -0.25 * L}
    named = ({"name": name, "title": f"force {name}", "x": x} for name, x in places.items())
    return [ActuatorTable.model_validate(force | of) for of in named]


def _belong_together(actuators: Sequence[Part], allocates: bool) -> None:
    """Refuse races of no propeller, and commands shared by those whose laws have others.

    Raises:
        DeclarationError: see above.
    """
    named = {a.name: a for a in actuators}
    for a in actuators:
        where, law = f"actuator '{a.name}'", Law.known[a.law]
        if law.in_race != bool(a.behind):
            right = f"{a.law} {'needs' if law.in_race else 'cannot have'} an 'upstream_propeller'"
            raise DeclarationError(f"{where}: {right}")
        if a.behind and (a.behind not in named or not Law.known[named[a.behind].law].has_race):
            raise DeclarationError(f"{where}: '{a.behind}' is not a propeller with a slipstream")
        alike = [b for b in actuators if (b.order or b.name) == (a.order or a.name)]
        if any(Law.known[b.law].commands != law.commands for b in alike):
            raise DeclarationError(
                f"{where}: the other actuators of its command group have other commands"
            )
        if len(alike) > 1 and a.number("half_spacing"):
            raise DeclarationError(
                f"{where}: two units abreast cannot share a command group with other actuators"
            )
        if a.number("half_spacing") and (law.has_race or law.in_race):
            raise DeclarationError(f"{where}: two units abreast cannot have or be an upstream propeller")
        if len(alike) > 1 and allocates:
            needs = "'thrust_allocation = false'"
            raise DeclarationError(f"{where}: a ship with command groups needs {needs}")


def _inertia(given: Mapping[str, Any], prime: Prime | None) -> tuple[Value, ...]:
    """Numbers of a ship's inertia.

    Raises:
        DeclarationError: one is missing, or the ship would gain energy by speeding up.
    """
    found = _values("inertia", given, variables(Inertia), prime)
    missing = [name for name in REQUIRED if name not in given]
    if missing:
        raise DeclarationError(f"inertia: {missing[0]} is missing")
    (surge, _, _), (_, sway, a), (_, b, yaw) = described_mass({v.name: v.value for v in found})
    if min(surge, sway, yaw) <= 0.0 or sway * yaw <= 0.25 * (a + b) * (a + b):
        raise DeclarationError("inertia: the mass matrix of these numbers is not positive definite")
    return found


def _once(names: list[str], where: str) -> None:
    twice = next((name for name in names if names.count(name) > 1), None)
    if twice is not None:
        raise DeclarationError(f"{where}: {twice} occurs twice")


def _box(length: float, beam: float) -> tuple[tuple[float, float], ...]:
    """The outline of a ship that is not described: a box with a pointed bow."""
    half, side = 0.5 * length, 0.5 * beam
    return ((half, 0.0), (0.6 * half, side), (-half, side), (-half, -side), (0.6 * half, -side))


def _values(
    where: str, given: Mapping[str, Any], declared: tuple[Variable, ...], prime: Prime | None
) -> tuple[Value, ...]:
    """Numbers by the names of parameters, each within its range.

    Raises:
        DeclarationError: there is no such parameter, or a number is out of its range.
    """
    known = {v.name: v for v in declared}
    found = []
    for name, value in given.items():
        if name not in known:
            raise DeclarationError(f"{where}: unknown key '{name}'{nearest(name, known)}")
        found.append(valued(name, value, known[name].unit, prime))
        limits: Range = known[name].range
        x = found[-1].value
        if (limits.min is not None and x < limits.min) or (limits.max is not None and x > limits.max):
            unit = "" if known[name].unit == "1" else f" {known[name].unit}"
            raise DeclarationError(f"{where}: {name} = {x:g}{unit} is out of its range ({limits.words})")
    return tuple(found)


def _function(name: str, given: Mapping[str, Given], prime: Prime | None) -> Part:
    _require(name, FUNCTIONS, f"hull.functions: there is no '{name}'")
    declared = parameters_of(name, 3, FUNCTIONS[name])
    return Part(name, name, name, _values(f"hull.functions.{name}", given, declared, prime))


def _require(name: str, known: Mapping[str, Any], lacking: str) -> None:
    """Refuse a law that is neither registered nor in an installed package, which then registers it.

    Raises:
        DeclarationError: there is none.
    """
    if name not in known and (file := installed.module_file(installed.LAWS, name)) is not None:
        STANDARD.plus_file(file)
    if name not in known:
        hint = nearest(name, known) or f"; there are {', '.join(known)}"
        raise DeclarationError(f"{lacking}{hint}")


def _actuator(a: ActuatorTable, scale: Scale, prime: Prime | None) -> Part:
    where = f"actuator '{a.name}'"
    _require(a.law, Law.known, f"{where}: there is no law '{a.law}'")
    law = Law.known[a.law]
    rates = [
        Variable(f"{c.name}_rate", f"{c.unit}/s", "limit of a command's rate", 0.0, Range(0.0))
        for c in law.commands
    ]
    declared = (
        *variables(law.Parameters),
        Variable("x", "m", "place", 0.0),
        Variable("y", "m", "place", 0.0),
        Variable("half_spacing", "m", "place of two units to port and starboard of it", 0.0, Range(0.0)),
        Variable("lag", "s", "first-order lag", 0.0, scale.limits("s", LONGEST)),
        *rates,
    )
    if keyword.iskeyword(a.name):
        raise DeclarationError(f"{where}: a keyword of Python cannot be a name")
    keys = [*ActuatorTable.model_fields, *(v.name for v in declared)]
    if unknown := next((name for name in a.model_extra or {} if name not in keys), None):
        raise DeclarationError(f"{where}: unknown key '{unknown}'{nearest(unknown, keys)}")
    numbers = {name: _checked(where, name, given) for name, given in (a.model_extra or {}).items()}
    title, values = a.title or a.name.replace("_", " "), _values(where, numbers, declared, prime)
    return Part(a.name, a.law, title, values, a.command_group or "", a.upstream_propeller, a.label)


def _checked(where: str, name: str, given: Any) -> "float | Number":
    """A number of an actuator, whose names depend on its law.

    Raises:
        DeclarationError: it is no number, nor a table with one.
    """
    try:
        return TypeAdapter(Given).validate_python(given)
    except ValidationError as error:
        raise DeclarationError(f"{where}: {name}: {first_fault(error, Given)}") from None

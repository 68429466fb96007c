"""How a component declares itself, and how its nested tuples map to a flat list of variables.

A field of a Params, Inputs or Outputs NamedTuple reads ``name: Annotated[float, unit, description]
= start``; behind the description may stand a :class:`Range`, for a parameter that only counts
at initialisation :data:`FIXED`, and for a coefficient of the nominal model a :class:`Known`. A field
may itself be such a NamedTuple, whose fields then join the flat list under their own names.
"""

import difflib
import importlib
import pkgutil
from collections import namedtuple
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache, cached_property
from inspect import signature
from typing import Annotated, Any, NamedTuple, get_args, get_origin, get_type_hints


class DeclarationError(Exception):
    """A component's declaration is incomplete or contradicts itself."""


def nearest(name: str, known: Iterable[str]) -> str:
    """A hint at the known name most like a wrong one; empty if none is like it."""
    known = list(known)
    same = [k for k in known if k.casefold() == name.casefold()]
    found = same or difflib.get_close_matches(name, known, 1, 0.5)
    return f"; did you mean '{found[0]}'?" if found else ""


@dataclass(frozen=True)
class Range:
    """The interval a variable must stay in; None leaves a side open."""

    min: float | None = None
    max: float | None = None


POSITIVE = Range(min=0.0)


@dataclass(frozen=True)
class Known:
    """Where the value of a nominal coefficient comes from, and how well it is known by that.

    Attributes:
        group: a name for all coefficients of its kind, such as ``mass`` or ``damping``.
        origin: how the value was found.
        share: standard deviation, as a share of the value.
    """

    group: str
    origin: str
    share: float


@dataclass(frozen=True)
class Estimate:
    """What a parameter is the first estimate of, from which an adaptive law learns.

    Attributes:
        of: a parameter of the plant.
        change: whether it is of what is added to that one.
    """

    of: str
    change: bool = False


class Outline(NamedTuple):
    """A ship as tools draw it.

    Attributes:
        name: of the ship.
        length: between perpendiculars [m].
        corners: (forward, to starboard) [m, m] of the waterline, from the body origin.
    """

    name: str
    length: float
    corners: tuple[tuple[float, float], ...]


FIXED = "fixed"
# Of a long communication step; beyond, somebody has mistaken a unit.
MOST_PARTS = 100_000


@dataclass(frozen=True)
class Variable:
    """One scalar of a component: what an FMI ScalarVariable shows."""

    name: str
    unit: str
    description: str
    start: float
    range: Range = Range()
    fixed: bool = False
    known: Known | None = None
    estimate: Estimate | None = None


def vector(typename: str, fields: Sequence[tuple[Any, ...]], extra: Sequence[Any] = ()) -> type[Any]:
    """A NamedTuple class of scalars that are made rather than written out.

    Args:
        typename: name of the class.
        fields: (name, unit, description, start, and what stands behind the description) of each scalar.
        extra: what stands behind the description of every field, such as a Range.

    Returns:
        The class, declared like a hand-written one.
    """
    made = namedtuple(typename, [f[0] for f in fields], defaults=[f[3] for f in fields])
    made.__annotations__ = {
        name: Annotated[(float, unit, description, *own, *extra)]
        for name, unit, description, _, *own in fields
    }
    return made


def bundle(typename: str, base: type[Any] | None = None, **groups: Any) -> type[Any]:
    """A NamedTuple class that nests declared NamedTuples, for classes that differ only in a part.

    Args:
        typename: name of the class.
        base: a declared NamedTuple class whose fields come first.
        groups: field -> the nested tuple with its start values.
    """
    starts = {**(base._field_defaults if base else {}), **groups}
    made = namedtuple(typename, list(starts), defaults=list(starts.values()))
    made.__annotations__ = {**(base.__annotations__ if base else {}), **dict.fromkeys(groups, Any)}
    return made


def group_of(typename: str, fields: Iterable[Variable]) -> type[Any]:
    """A NamedTuple class of scalars, declared by what :func:`variables` gives of such a class."""
    fields = list(fields)
    made = namedtuple(typename, [v.name for v in fields], defaults=[v.start for v in fields])
    made.__annotations__ = {v.name: _annotation(v) for v in fields}
    return made


def _annotation(v: Variable) -> Any:
    more = [extra for extra in (v.known, v.estimate, FIXED if v.fixed else None) if extra is not None]
    return Annotated[(float, v.unit, v.description, v.range, *more)]


def redeclared(cls: type[Any], change: Callable[[Variable], Variable]) -> type[Any]:
    """A NamedTuple class with the same fields, each declared as ``change`` makes it of its declaration.

    Args:
        cls: a declared NamedTuple class, nested or not.
        change: gives a variable of the same name, with another start value, range or origin.
    """
    nested = _shape(cls)
    if not any(nested):
        return group_of(cls.__name__, map(change, variables(cls)))
    own = iter(change(v) for v in variables(cls) if v.name in cls._fields)
    groups: dict[str, Any] = {}
    annotations: dict[str, Any] = {}
    for name, inner in zip(cls._fields, nested, strict=True):
        if inner is None:
            v = next(own)
            groups[name], annotations[name] = v.start, _annotation(v)
        else:
            groups[name], annotations[name] = redeclared(inner, change)(), Any
    made = namedtuple(cls.__name__, list(groups), defaults=list(groups.values()))
    made.__annotations__ = annotations
    return made


def parameters_of(name: str, leading: int, function: Callable[..., Any]) -> tuple[Variable, ...]:
    """The parameters that a function declares in its signature.

    Args:
        name: of what the function is, for messages.
        leading: how many arguments stand before the parameters.
        function: further arguments read ``name: Annotated[float, unit, description, ...] = start``.

    Raises:
        DeclarationError: a parameter without unit, description or start value.
    """
    arguments = list(signature(function).parameters.values())[leading:]
    hints = get_type_hints(function, include_extras=True)
    group = type(
        name,
        (),
        {
            "__annotations__": {a.name: hints.get(a.name, Any) for a in arguments},
            "_field_defaults": {a.name: a.default for a in arguments if a.default is not a.empty},
        },
    )
    return variables(group)


@cache
def variables(cls: type[Any]) -> tuple[Variable, ...]:
    """The scalars of a declared NamedTuple class, nested ones included, in order.

    Raises:
        DeclarationError: a field without start value, unit or description.
    """
    found: list[Variable] = []
    defaults = getattr(cls, "_field_defaults", {})
    for name, hint in get_type_hints(cls, include_extras=True).items():
        nested = _nested(cls, name, hint)
        if nested is not None:
            found += variables(nested)
            continue
        meta = get_args(hint)[1:] if get_origin(hint) is Annotated else ()
        if len(meta) < 2 or not all(isinstance(text, str) for text in meta[:2]):
            raise DeclarationError(f"{cls.__name__}.{name} needs a unit and a description")
        if name not in defaults:
            raise DeclarationError(f"{cls.__name__}.{name} needs a start value")
        more = {type(extra): extra for extra in meta[2:]}
        found.append(
            Variable(
                name,
                meta[0],
                meta[1],
                float(defaults[name]),
                more.get(Range, Range()),
                FIXED in meta[2:],
                more.get(Known),
                more.get(Estimate),
            )
        )
    return tuple(found)


def _nested(cls: type[Any], name: str, hint: Any) -> type[Any] | None:
    """The NamedTuple class behind a field, if it is one by its hint or by its start value."""
    if isinstance(hint, type) and hasattr(hint, "_fields"):
        return hint
    start = getattr(cls, "_field_defaults", {}).get(name)
    return type(start) if hasattr(start, "_fields") else None


def _shape(cls: type[Any]) -> list[type[Any] | None]:
    """For each field the NamedTuple class behind it, None for a scalar."""
    return [_nested(cls, name, hint) for name, hint in get_type_hints(cls).items()]


@cache
def width(cls: type[Any]) -> int:
    """How many scalars a NamedTuple class holds, nested ones included."""
    return sum(1 if nested is None else width(nested) for nested in _shape(cls))


@cache
def packer(cls: type[Any]) -> Callable[[Sequence[Any]], Any]:
    """A function that turns a flat sequence of scalars into an instance of the class."""
    shape = _shape(cls)
    if not any(shape):
        return cls._make
    parts: list[tuple[int, int, Callable[[Sequence[Any]], Any] | None]] = []
    start = 0
    for nested in shape:
        size = 1 if nested is None else width(nested)
        parts.append((start, start + size, None if nested is None else packer(nested)))
        start += size

    def pack(flat: Sequence[Any]) -> Any:
        return cls._make([flat[a] if sub is None else sub(flat[a:b]) for a, b, sub in parts])

    return pack


def flatten(value: Any) -> list[Any]:
    """The scalars of a nested tuple in order: the inverse of :func:`packer`."""
    flat: list[Any] = []
    for item in value:
        if item.__class__ is float:  # the usual case, and the quickest to tell
            flat.append(item)
        elif isinstance(item, tuple):
            flat += flatten(item)
        else:
            flat.append(item)
    return flat


def rebuild(template: Any, flat: Sequence[Any]) -> Any:
    """The flat scalars in the shape of a nested tuple, of whatever kinds its tuples are."""
    scalars = iter(flat)

    def like(part: Any) -> Any:
        if not isinstance(part, tuple):
            return next(scalars)
        items = [like(item) for item in part]
        return type(part)._make(items) if hasattr(part, "_make") else tuple(items)  # pyright: ignore

    return like(template)


@dataclass(frozen=True, eq=False)
class Component:
    """A component's name, its four NamedTuple classes and its two pure functions.

    Attributes:
        name: name of the FMU.
        description: one line for people.
        params, state, inputs, outputs: NamedTuple classes.
        init: ``init(inputs, params) -> state``.
        step: ``step(state, inputs, params, h) -> (state, outputs)``; h [s] = 0 gives the outputs at
            the present state and changes nothing.
        sampled: True for a law that acts at its sampling instants, so that an output may use the
            input of the same instant; False for a plant in continuous time, where the input acts
            through the integral (and through direct feedthrough, found by tracing).
        held: inputs of a sampled law that act over the whole step, as the force does that moved a ship
            between two measurements: an output follows the value of the step's start.
        hold_nonfinite: True where an input that is NaN or infinite keeps its last finite value; False
            for a component that makes its own sense of such a value.
        max_step: a longer communication step [s] is divided into equal parts no longer than this.
        prepare: ``prepare(params)`` gives what follows from the parameters alone, where computing it
            anew in every step would cost time.
        prepared_step: ``step`` with what ``prepare`` gives in place of the parameters.
        starts: start values of parameters and inputs that are not those of the declaration.
        any_ship: whether it serves every ship; False where it serves the default one alone.
        outline: of the ship that it is the hull of.
        trial: the manoeuvring trial that it conducts by its output ``order``; empty: none.
    """

    name: str
    description: str
    params: type[Any]
    state: type[Any]
    inputs: type[Any]
    outputs: type[Any]
    init: Callable[[Any, Any], Any]
    step: Callable[[Any, Any, Any, Any], tuple[Any, Any]]
    sampled: bool = True
    max_step: float | None = None
    hold_nonfinite: bool = True
    held: tuple[str, ...] = ()
    prepare: Callable[[Any], Any] | None = None
    prepared_step: Callable[[Any, Any, Any, Any], tuple[Any, Any]] | None = None
    starts: Mapping[str, float] = field(default_factory=dict)
    any_ship: bool = True
    outline: Outline | None = None
    trial: str = ""

    def starting(self, starts: Mapping[str, float]) -> "Component":
        """The same component with other start values of some parameters or inputs."""
        return replace(self, starts={**self.starts, **starts})

    def prepared(self, params: Any) -> Any:
        """What :meth:`advance` wants of the parameters: to be kept while they stay the same."""
        return params if self.prepare is None else self.prepare(params)

    def advance(self, state: Any, inputs: Any, prepared: Any, h: float) -> tuple[Any, Any]:
        """One communication step of h [s], in parts where it is longer than ``max_step``."""
        step = self.prepared_step or self.step
        if self.max_step is None or h <= self.max_step * (1.0 + 1e-9):
            return step(state, inputs, prepared, h)
        if h > MOST_PARTS * self.max_step:
            raise ValueError(f"a step of {h} s is too long: {self.max_step} s are integrated at once")
        parts = -int(-h / self.max_step // 1.0)
        outputs = None
        for _ in range(parts):
            state, outputs = step(state, inputs, prepared, h / parts)
        return state, outputs

    @cached_property
    def variables(self) -> list[Variable]:
        """All scalars in the order of their value references: parameters, inputs, outputs."""
        found = [
            *variables(self.params),
            *variables(self.inputs),
            *variables(self.outputs),
        ]
        names = [variable.name for variable in found]
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            raise DeclarationError(f"{self.name} declares {', '.join(twice)} more than once")
        return [replace(v, start=self.starts.get(v.name, v.start)) for v in found]


# Folders of this package that hold components, one a module.
KINDS = ("controller", "guidance", "observer", "thrusters", "vessel", "watch")


def component(
    name: str,
    description: str,
    init: Callable[[Any, Any], Any],
    step: Callable[[Any, Any, Any, Any], tuple[Any, Any]],
    **more: Any,
) -> Component:
    """A component of the classes that its functions say they take and give.

    Args:
        name: name of the FMU.
        description: one line for people.
        init: annotated ``init(i: Inputs, p: Params) -> State``.
        step: annotated ``step(...) -> tuple[State, Outputs]``.
        more: further attributes of the :class:`Component`.

    Raises:
        DeclarationError: a function lacks these annotations.
    """
    hints, given = get_type_hints(init), get_args(get_type_hints(step).get("return"))
    if len(hints) != 3 or "return" not in hints or len(given) != 2:
        raise DeclarationError(
            f"{name}: init and step need annotations, init(i: Inputs, p: Params) -> State and "
            "step(s: State, i: Inputs, p: Params, h: Number) -> tuple[State, Outputs]"
        )
    inputs, params, state = hints.values()
    _, outputs = given
    return Component(name, description, params, state, inputs, outputs, init, step, **more)


def discover(ship: Any) -> Iterator[tuple[str, Component]]:
    """Every (module name, component) of this project, found by importing the modules of all kinds.

    Args:
        ship: a :class:`~fmus.ship.Ship` that the components are to be made for.
    """
    root = __package__ or "fmus"
    for kind in KINDS:
        package = importlib.import_module(f"{root}.{kind}")
        for info in pkgutil.iter_modules(package.__path__):
            name = f"{root}.{kind}.{info.name}"
            module = importlib.import_module(name)
            made = ship.component(getattr(module, "COMPONENT", None), module)
            if made is not None:
                yield name, made

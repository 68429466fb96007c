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
from types import ModuleType
from typing import (
    TYPE_CHECKING,
    Annotated,
    Any,
    ClassVar,
    Generic,
    NamedTuple,
    Protocol,
    TypeVar,
    cast,
    get_args,
    get_origin,
    get_type_hints,
)

from .ops import Number

if TYPE_CHECKING:

    class Fields(tuple[Any, ...]):
        """Values of a NamedTuple class that is made at run time, so that no checker knows its fields.

        A field is a number, or a record where the class nests others.
        """

        _fields: ClassVar[tuple[str, ...]]
        _field_defaults: ClassVar[Mapping[str, Any]]

        def __new__(cls, *fields: object, **named: object) -> "Fields": ...
        def __getattr__(self, name: str) -> Any: ...
        def _replace(self, **fields: object) -> "Fields": ...
        @classmethod
        def _make(cls, fields: Iterable[object]) -> "Fields": ...

else:
    Fields = tuple

Declared = type[tuple[object, ...]]  # a declared NamedTuple class, written out or made at run time
_T = TypeVar("_T", bound=tuple[object, ...])


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

    @property
    def words(self) -> str:
        """The interval in words; empty if both sides are open."""
        if self.min is None:
            return "" if self.max is None else f"at most {self.max:g}"
        return f"{self.min:g} to {self.max:g}" if self.max is not None else f">= {self.min:g}"


POSITIVE = Range(min=0.0)


@dataclass(frozen=True)
class Known:
    """Where the value of a nominal coefficient comes from, and how well it is known by that.

    Attributes:
        group: a name for all coefficients of its kind, such as ``mass`` or ``damping``.
        origin: how the value was found.
        share: standard deviation, as a share of the value.
        std: the same in the value's unit, which then holds for any value; 0: the share holds.
    """

    group: str
    origin: str
    share: float
    std: float = 0.0

    def deviation(self, value: float) -> float:
        """Standard deviation of a value, in its unit."""
        return self.std or abs(value) * self.share


@dataclass(frozen=True)
class FirstEstimate:
    """What a parameter is the first estimate of, from which an adaptive law learns.

    Attributes:
        of: a parameter of the plant.
        change: whether it is of what is added to that one.
    """

    of: str
    change: bool = False


class ShipOutline(NamedTuple):
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
    estimate: FirstEstimate | None = None


def _fields_class(
    typename: str, starts: Mapping[str, object], annotations: Mapping[str, object]
) -> type[Fields]:
    made: Any = namedtuple(typename, list(starts), defaults=list(starts.values()))
    made.__annotations__ = dict(annotations)
    return made


def bundle(typename: str, base: Declared | None = None, **groups: tuple[object, ...]) -> type[Fields]:
    """A NamedTuple class that nests declared NamedTuples, for classes that differ only in a part.

    Args:
        typename: name of the class.
        base: a declared NamedTuple class whose fields come first.
        groups: field -> the nested tuple with its start values.
    """
    starts = {**(_starts(base) if base else {}), **groups}
    annotations = {**(base.__annotations__ if base else {}), **dict.fromkeys(groups, Fields)}
    return _fields_class(typename, starts, annotations)


def group_of(typename: str, fields: Iterable[Variable]) -> type[Fields]:
    """A NamedTuple class of scalars, declared by what :func:`variables` gives of such a class."""
    fields = list(fields)
    return _fields_class(
        typename, {v.name: v.start for v in fields}, {v.name: _annotation(v) for v in fields}
    )


def _annotation(v: Variable) -> object:
    more = [extra for extra in (v.known, v.estimate, FIXED if v.fixed else None) if extra is not None]
    return Annotated[(float, v.unit, v.description, v.range, *more)]


def redeclared(cls: Declared, change: Callable[[Variable], Variable]) -> type[Fields]:
    """A NamedTuple class with the same fields, each declared as ``change`` makes it of its declaration.

    Args:
        cls: a declared NamedTuple class, nested or not.
        change: gives a variable of the same name, with another start value, range or origin.
    """
    before = variables(cls)
    after = [change(v) for v in before]
    if after == list(before):
        return cast("type[Fields]", cls)
    nested = _shape(cls)
    if not any(nested):
        return group_of(cls.__name__, after)
    names: tuple[str, ...] = getattr(cls, "_fields")  # noqa: B009 - of every NamedTuple class
    own = iter(v for v in after if v.name in names)
    starts: dict[str, object] = {}
    annotations: dict[str, object] = {}
    for name, inner in zip(names, nested, strict=True):
        if inner is None:
            v = next(own)
            starts[name], annotations[name] = v.start, _annotation(v)
        else:
            starts[name], annotations[name] = redeclared(inner, change)(), Fields
    return _fields_class(cls.__name__, starts, annotations)


def parameters_of(name: str, leading: int, function: Callable[..., object]) -> tuple[Variable, ...]:
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
            "__annotations__": {a.name: hints.get(a.name, object) for a in arguments},
            "_field_defaults": {a.name: a.default for a in arguments if a.default is not a.empty},
        },
    )
    return variables(group)


@cache
def variables(cls: type) -> tuple[Variable, ...]:
    """The scalars of a declared NamedTuple class, nested ones included, in order.

    Raises:
        DeclarationError: a field without start value, unit or description.
    """
    found: list[Variable] = []
    defaults = _starts(cls)
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
                more.get(FirstEstimate),
            )
        )
    return tuple(found)


def _starts(cls: type) -> Mapping[str, Any]:
    return getattr(cls, "_field_defaults", {})


def _nested(cls: type, name: str, hint: object) -> Declared | None:
    """The NamedTuple class behind a field, if it is one by its hint or by its start value."""
    if isinstance(hint, type) and hasattr(hint, "_fields"):
        return hint
    start = _starts(cls).get(name)
    return type(start) if isinstance(start, tuple) and hasattr(start, "_fields") else None


def _shape(cls: Declared) -> list[Declared | None]:
    """For each field the NamedTuple class behind it, None for a scalar."""
    return [_nested(cls, name, hint) for name, hint in get_type_hints(cls).items()]


@cache
def width(cls: Declared) -> int:
    """How many scalars a NamedTuple class holds, nested ones included."""
    return sum(1 if nested is None else width(nested) for nested in _shape(cls))


def packer(cls: type[_T]) -> Callable[[Sequence[object]], _T]:
    """A function that turns a flat sequence of scalars into an instance of the class."""
    return _packer(cls)


@cache
def _packer(cls: Any) -> Callable[[Sequence[object]], Any]:
    shape = _shape(cls)
    if not any(shape):
        return cls._make
    parts: list[tuple[int, int, Callable[[Sequence[object]], object] | None]] = []
    start = 0
    for nested in shape:
        size = 1 if nested is None else width(nested)
        parts.append((start, start + size, None if nested is None else packer(nested)))
        start += size

    def pack(flat: Sequence[object]) -> object:
        return cls._make([flat[a] if sub is None else sub(flat[a:b]) for a, b, sub in parts])

    return pack


def flatten(value: Iterable[Any]) -> list[Number]:
    """The scalars of a nested tuple in order: the inverse of :func:`packer`."""
    flat: list[Number] = []
    for item in value:
        if item.__class__ is float:  # the usual case, and the quickest to tell
            flat.append(item)
        elif isinstance(item, tuple):
            flat += flatten(item)
        else:
            flat.append(item)
    return flat


def rebuild(template: _T, flat: Sequence[object]) -> _T:
    """The flat scalars in the shape of a nested tuple, of whatever kinds its tuples are."""
    scalars = iter(flat)

    def like(part: object) -> Any:
        if not isinstance(part, tuple):
            return next(scalars)
        items = [like(item) for item in part]
        return type(part)._make(items) if hasattr(part, "_make") else tuple(items)  # pyright: ignore

    return like(template)


_I = TypeVar("_I", bound=tuple[object, ...])
_P = TypeVar("_P", bound=tuple[object, ...])
_S = TypeVar("_S", bound=tuple[object, ...])
_O = TypeVar("_O", bound=tuple[object, ...])
_I_in = TypeVar("_I_in", bound=tuple[object, ...], contravariant=True)
_P_in = TypeVar("_P_in", contravariant=True)
_S_out = TypeVar("_S_out", bound=tuple[object, ...], covariant=True)
_O_out = TypeVar("_O_out", bound=tuple[object, ...], covariant=True)


class Init(Protocol[_I_in, _P_in, _S_out]):
    """``init(inputs, params) -> state``: the state in which a component begins.

    Receives the inputs and parameters at the start of the simulation, as instances of the declared
    classes. Returns nested tuples of numbers; their shape, that of every later state, does not depend on
    values. Pure: it reads nothing but its arguments and changes nothing.
    """

    def __call__(self, inputs: _I_in, params: _P_in, /) -> _S_out: ...


class Prepare(Protocol[_P_in]):
    """``prepare(params) -> prepared``: what follows from the parameters alone.

    Receives the parameters; is called again where one of them has changed, and before the first step.
    Returns what the ``prepared_step`` of the same component gets in their place: numbers in any nested
    tuples, lists and dicts, and constants. Pure, as :class:`Init` is.
    """

    def __call__(self, params: _P_in, /) -> Any: ...


class Step(Protocol[_S, _I_in, _P_in, _O_out]):
    """``step(state, inputs, params, h) -> (state, outputs)``: h [s] later.

    Receives the state that :class:`Init` or the last step gave, the inputs that hold during the step,
    the parameters (or what :class:`Prepare` gave), and h >= 0. Returns the next state in the shape of
    the last one, and the outputs as an instance of the declared class. With h = 0 the outputs are those
    of the present state, and the next step gives what it would give without this one. Pure: the same
    arguments give the same numbers, and no argument is changed, so that a step may be repeated and
    rolled back. It never branches on a value, which may be a float, an array or a symbol
    (:data:`fmus.ops.Number`).
    """

    def __call__(self, state: _S, inputs: _I_in, params: _P_in, h: Number, /) -> tuple[_S, _O_out]: ...


@dataclass(frozen=True, eq=False)
class Component(Generic[_S, _I, _P, _O]):
    """A component's name, its four NamedTuple classes and its two pure functions.

    Attributes:
        name: name of the FMU.
        description: one line for people.
        params, state, inputs, outputs: NamedTuple classes.
        init: see :class:`Init`.
        step: see :class:`Step`.
        sampled: True for a law that acts at its sampling instants, so that an output may use the
            input of the same instant. False for a plant in continuous time, where the input acts
            through the integral (and through direct feedthrough, found by tracing).
        held: inputs of a sampled law that act over the whole step, as the force does that moved a ship
            between two measurements: an output follows the value of the step's start.
        hold_nonfinite: True where an input that is NaN or infinite keeps its last finite value; False
            for a component that makes its own sense of such a value.
        max_step: a longer communication step [s] is divided into equal parts no longer than this.
        prepare: see :class:`Prepare`; where computing it anew in every step would cost time.
        prepared_step: ``step`` with what ``prepare`` gives in place of the parameters.
        starts: start values of parameters and inputs that are not those of the declaration.
        any_ship: whether it serves every ship; False where it serves the default one alone.
        outline: of the ship that it is the hull of.
        trial: the manoeuvring trial that it conducts by its output ``order``; empty: none.
    """

    name: str
    description: str
    params: type[_P]
    state: type[_S]
    inputs: type[_I]
    outputs: type[_O]
    init: Init[_I, _P, _S]
    step: Step[_S, _I, _P, _O]
    sampled: bool = True
    max_step: float | None = None
    hold_nonfinite: bool = True
    held: tuple[str, ...] = ()
    prepare: Prepare[_P] | None = None
    prepared_step: Step[_S, _I, Any, _O] | None = None
    starts: Mapping[str, float] = field(default_factory=dict)
    any_ship: bool = True
    outline: ShipOutline | None = None
    trial: str = ""

    def starting(self, starts: Mapping[str, float]) -> "Component[_S, _I, _P, _O]":
        """The same component with other start values of some parameters or inputs."""
        return replace(self, starts={**self.starts, **starts})

    def prepared(self, params: _P) -> Any:
        """The argument of :meth:`advance` by the parameters, to be kept while they are the same."""
        return params if self.prepare is None else self.prepare(params)

    @property
    def law(self) -> Step[_S, _I, Any, _O]:
        """The step that takes what :meth:`prepared` gives."""
        return self.prepared_step or self.step

    def advance(self, state: _S, inputs: _I, prepared: Any, h: float) -> tuple[_S, _O]:
        """One communication step of h [s], in parts where it is longer than ``max_step``."""
        step = self.law
        if self.max_step is None or h <= self.max_step * (1.0 + 1e-9):
            return step(state, inputs, prepared, h)
        if h > MOST_PARTS * self.max_step:
            raise ValueError(f"a step of {h} s is too long: {self.max_step} s are integrated at once")
        parts = -int(-h / self.max_step // 1.0)
        for _ in range(parts - 1):
            state, _ = step(state, inputs, prepared, h / parts)
        return step(state, inputs, prepared, h / parts)

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
    init: Init[_I, _P, _S],
    step: Step[_S, _I, _P, _O],
    **more: Any,
) -> Component[_S, _I, _P, _O]:
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


class ComponentMaker(Protocol):
    """A ship, as far as :func:`discover` needs it."""

    def component(self, component: Component | None, module: ModuleType, /) -> Component | None:
        """A component of a module, made for this ship; None: it has none for such a ship."""
        ...


def discover(ship: ComponentMaker) -> Iterator[tuple[str, Component]]:
    """Every (module name, component) of this project, found by importing the modules of all kinds.

    Args:
        ship: that the components are to be made for.
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

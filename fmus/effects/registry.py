"""The one registry of model effects: what the real ship may have and the nominal model lacks.

An effect is a pure function with a decorator. From it come the parameters of the vessel's and the
thrusters' FMU (zero: no effect), the force outputs, the table of the documentation and the regressors of
an analysis. The function's first argument and its result belong to the kind:

=============  ==========================================  =========================================
kind           first argument                              result
=============  ==========================================  =========================================
force          :class:`Ship`                               force on the hull (X, Y, N) [N, N, N m]
environment    :class:`Ship`                               the same; "current": the water's velocity
inertia        :class:`~fmus.hull.Inertia`                 the changed Inertia
actuator       :class:`Thrust`, :class:`Running`           the changed Thrust
measurement    measured pose (x, y, psi) [m, m, rad]       the changed pose
=============  ==========================================  =========================================

Every further argument is a parameter, ``name: Annotated[float, unit, description, Range?] = start``. The
parameters that start at zero are the effect's coefficients: with all of them zero there is no effect.
"""

import importlib.util
import re
import sys
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from inspect import signature
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple, get_args, get_type_hints

from ..declare import DeclarationError, Variable, nearest, variables, vector
from ..ops import Number, when

Kind = Literal["force", "inertia", "actuator", "environment", "measurement"]


class Ship(NamedTuple):
    """Pose, heading continuous over turns, velocity, and time.

    A force on the hull may depend on all of it; to an effect the velocity is that through the water.
    """

    x: Any = 0.0
    y: Any = 0.0
    psi: Any = 0.0
    u: Any = 0.0
    v: Any = 0.0
    r: Any = 0.0
    t: Any = 0.0


class Running(NamedTuple):
    """What a thruster's force may depend on: time [s], velocity, commands -1...1."""

    t: Any = 0.0
    u: Any = 0.0
    v: Any = 0.0
    r: Any = 0.0
    u_vsp_x: Any = 0.0
    u_vsp_y: Any = 0.0
    u_bow: Any = 0.0


class Thrust(NamedTuple):
    """Forces of the thrusters [N], and what turns their sum into tau.

    ``loss_*`` is the part of tau that is lost on each axis; ``dx`` and ``dy`` [m] is how far from the
    assumed point the force acts.
    """

    vsp_x: Any = 0.0
    vsp_y: Any = 0.0
    bow: Any = 0.0
    loss_X: Any = 0.0
    loss_Y: Any = 0.0
    loss_N: Any = 0.0
    dx: Any = 0.0
    dy: Any = 0.0


@dataclass(frozen=True)
class Effect:
    """One effect.

    Attributes:
        id: its name in scenarios, reports and results.
        kind: what it acts on, see the table above.
        axis: axes that its force acts on: X, Y, N, XY, XN, YN or XYN.
        description: one line for people.
        formula, symbol, sign, source: how it is written, what positive values do, where it is from.
        linear: True where the force is linear in the coefficients.
        parameters: its parameters, in the order of the function's arguments.
        settings: parameters that say how the effect acts, not how strong it is.
        function: the effect itself; None where it needs a memory, or where the master causes it.
    """

    id: str
    kind: Kind
    axis: str
    description: str
    formula: str
    symbol: str
    sign: str
    source: str
    linear: bool
    parameters: tuple[Variable, ...]
    function: Callable[..., Any] | None
    settings: frozenset[str] = frozenset()

    @property
    def slug(self) -> str:
        """The id as a name of variables: ``X_absu_u`` for ``X_|u|u``."""
        named = re.sub(r"\|(\w)\|", r"abs\1_", self.id)
        return re.sub(r"\W+", "_", named).strip("_")

    @property
    def coefficients(self) -> tuple[str, ...]:
        """Names of the parameters that are zero where there is no effect."""
        return tuple(p.name for p in self.parameters if p.name not in self.settings)

    def regressors(self, *at: Any) -> list[Any]:
        """What one unit of each coefficient gives alone, for an effect that is linear in them.

        Args:
            at: the function's leading arguments, scalars or arrays in them.

        Returns:
            For each coefficient the function's result.
        """
        if not self.linear or self.function is None:
            raise ValueError(f"{self.id} is not linear in its coefficients")
        starts = {p.name: p.start for p in self.parameters}
        units = [starts | {name: 1.0} for name in self.coefficients]
        return [self.function(*at, *unit.values()) for unit in units]


EFFECTS: dict[str, Effect] = {}
# Users' files that were loaded, by the name under which they were.
LOADED: dict[str, Path] = {}


def add(effect: Effect) -> None:
    """Put an effect into the registry.

    Raises:
        DeclarationError: its id or one of its parameters is taken.
    """
    taken = {p.name: e.id for e in EFFECTS.values() for p in e.parameters}
    if effect.id in EFFECTS:
        raise DeclarationError(f"there is an effect '{effect.id}' already")
    for name in [p.name for p in effect.parameters]:
        if name in taken:
            raise DeclarationError(f"'{name}' is a parameter of the effect '{taken[name]}' already")
    EFFECTS[effect.id] = effect


def effect(
    id: str,  # noqa: A002
    kind: Kind,
    axis: str,
    *,
    formula: str = "",
    symbol: str = "",
    sign: str = "",
    source: str = "",
    linear: bool = True,
    settings: Iterable[str] = (),
) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """Decorator that registers a function as an effect; its docstring's first line describes it.

    Args:
        id, kind, axis, formula, symbol, sign, source, linear, settings: see :class:`Effect`; a
            parameter that does not start at zero is a setting anyway.

    Raises:
        DeclarationError: unknown kind or axis, or a parameter without unit, description or start.
    """

    def register(function: Callable[..., Any]) -> Callable[..., Any]:
        if kind not in get_args(Kind):
            raise DeclarationError(f"{id}: no kind '{kind}'; there are {', '.join(get_args(Kind))}")
        if not axis or not set(axis) <= set("XYN"):
            raise DeclarationError(f"{id}: the axis must be made of X, Y and N, not '{axis}'")
        lines = (function.__doc__ or "").strip().splitlines()
        if not lines:
            raise DeclarationError(f"{id}: the first line of the docstring describes the effect")
        parameters = _parameters(id, kind, function)
        how = frozenset(settings) | {p.name for p in parameters if p.start != 0.0}
        symbols = symbol or ", ".join(p.name for p in parameters if p.name not in how)
        if not symbols:
            raise DeclarationError(f"{id} needs a parameter that starts at 0, where it has no effect")
        text = (lines[0], formula, symbols, sign, source)
        add(Effect(id, kind, axis, *text, linear, parameters, function, how))
        return function

    return register


def _parameters(name: str, kind: Kind, function: Callable[..., Any]) -> tuple[Variable, ...]:
    """The declared parameters of an effect's function."""
    skip = 2 if kind == "actuator" else 1
    arguments = list(signature(function).parameters.values())[skip:]
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


def effects(*kinds: Kind) -> list[Effect]:
    """The registered effects of some kinds: kind by kind, in the order of registration."""
    return [e for kind in kinds for e in EFFECTS.values() if e.kind == kind]


def find(name: str) -> Effect:
    """An effect by its id.

    Raises:
        KeyError: there is none; the message names the nearest.
    """
    if name not in EFFECTS:
        raise KeyError(f"no effect '{name}'{nearest(name, EFFECTS)}")
    return EFFECTS[name]


def _any(coefficients: Iterable[int], values: Any) -> Number:
    """Whether any of some values is not zero."""
    total = 0.0
    for k in coefficients:
        total = total + abs(values[k])
    return total > 0.0


class Member(NamedTuple):
    """An effect in a group: where its parameters and its coefficients lie among the group's."""

    effect: Effect
    parameters: slice
    coefficients: tuple[int, ...]

    def acting(self, values: Any) -> Number:
        """Whether any coefficient is not zero, for the group's parameters."""
        return _any(self.coefficients, values)

    def apply(self, acts: Number, values: Any, otherwise: Any, *at: Any) -> Any:
        """What the effect makes of its leading arguments.

        Args:
            acts: whether it acts, from :meth:`acting`.
            values: the group's parameters.
            otherwise: what holds without the effect.
            at: the leading arguments of the effect's function.
        """
        if acts is False:  # as most effects do, most of the time
            return otherwise
        function = self.effect.function
        assert function is not None
        return when(acts, lambda: function(*at, *values[self.parameters]), lambda: otherwise)


class Group(NamedTuple):
    """Effects that act together in one component, and the NamedTuple class of their parameters."""

    params: type[Any]
    members: tuple[Member, ...]

    def acting(self, values: Any) -> Number:
        """Whether any effect acts, for the group's parameters."""
        return _any([k for member in self.members for k in member.coefficients], values)


def group(typename: str, chosen: Iterable[Effect]) -> Group:
    """The parameters of some effects as a NamedTuple class for a component."""
    members: list[Member] = []
    found: list[Variable] = []
    for e in chosen:
        first = len(found)
        found += e.parameters
        which = tuple(k for k, p in enumerate(e.parameters, first) if p.name in e.coefficients)
        members.append(Member(e, slice(first, len(found)), which))
    fields = [(p.name, p.unit, p.description, p.start) for p in found]
    made = vector(typename, fields)
    made.__annotations__ = {p.name: Annotated[(float, p.unit, p.description, p.range)] for p in found}
    return Group(made, tuple(members))


def load(path: Path) -> list[str]:
    """Register the effects of a user's file.

    Args:
        path: a Python file with functions decorated by :func:`effect`.

    Returns:
        The ids of its effects.

    Raises:
        DeclarationError: the file cannot be read, fails, or has no effect.
    """
    before = set(EFFECTS)
    taken = {found.stem for found in Path(__file__).parent.iterdir()} | set(LOADED)
    if not path.stem.isidentifier() or path.stem in taken:
        raise DeclarationError(f"'{path}': a file of effects cannot be called '{path.stem}'")
    spec = importlib.util.spec_from_file_location(f"{__package__}.{path.stem}", path)
    if not path.is_file() or spec is None or spec.loader is None:
        raise DeclarationError(f"no such Python file of effects: '{path}'")
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    try:
        spec.loader.exec_module(module)
    except (Exception, SystemExit) as error:
        for name in set(EFFECTS) - before:
            del EFFECTS[name]
        raise DeclarationError(f"'{path}' fails when imported: {error!r}") from error
    found = [name for name in EFFECTS if name not in before]
    if not found:
        raise DeclarationError(f"'{path}' registers no effect; decorate a function with @effect(...)")
    LOADED[path.stem] = path
    return found

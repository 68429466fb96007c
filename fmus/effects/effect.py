"""The declaration of a model effect: what the real ship may have and the nominal model lacks.

An effect is a pure function with the decorator :func:`effect`, which says everything about it in one
place. From it come the parameters of the vessel's and the thrusters' FMU (zero: no effect), the force
outputs, the table of the documentation, the candidates of an identification, and the text of a finding.
The function's first arguments and its result belong to the kind:

=============  ==========================================  =========================================
kind           first arguments                             result
=============  ==========================================  =========================================
force          :class:`Loaded`: a motion and tau           force on the hull (X, Y, N) [N, N, N m]
environment    :class:`Loaded`; :class:`Motion` for what   the same, or what ``gives`` says
               gives a velocity of the water
inertia        :class:`~fmus.hull.Inertia`                 the changed Inertia
actuator       :class:`Thrust`, :class:`Running`           the changed Thrust
actuator with  memory, three signals, step h [s]           the next memory, the changed signals
a memory
measurement    measured pose (x, y, psi) [m, m, rad]       the changed pose
=============  ==========================================  =========================================

Every further argument is a parameter, ``name: Annotated[float, unit, description, Range?] = start``. The
parameters that start at zero are the effect's coefficients: with all of them zero there is no effect.
"""

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal, NamedTuple, get_args

from ..declare import DeclarationError, Variable, parameters_of
from ..docstring import docstring
from ..hull import Damping
from ..ops import Number, Series
from .families import UNKNOWN, Family

EffectFunction = Callable[..., Any]  # its arguments and its result belong to the kind, see above
Kind = Literal["force", "inertia", "actuator", "environment", "measurement"]

Shows = Literal["damping over speed", "force over command", "force given", "effectiveness over speed"]


class Picture(NamedTuple):
    """A curve that shows an effect.

    Attributes:
        what: the curve.
        whose: title of the actuators.
        members: their numbers; the force of the first is shown.
        commands: for each of these the number of the command that makes the force.
        axis: of the force, X or Y.
    """

    what: Shows
    whose: str = ""
    members: tuple[int, ...] = ()
    commands: tuple[int, ...] = ()
    axis: str = "X"


class Motion(NamedTuple):
    """Pose, heading continuous over turns, velocity, and time.

    A force on the hull may depend on all of it; to an effect the velocity is that through the water.
    """

    x: Series = 0.0
    y: Series = 0.0
    psi: Series = 0.0
    u: Series = 0.0
    v: Series = 0.0
    r: Series = 0.0
    t: Series = 0.0


class Loaded(NamedTuple):
    """A :class:`Motion`, the thrusters' force on the hull [N, N, N m], and the hull's damping."""

    x: Series = 0.0
    y: Series = 0.0
    psi: Series = 0.0
    u: Series = 0.0
    v: Series = 0.0
    r: Series = 0.0
    t: Series = 0.0
    tau_X: Series = 0.0
    tau_Y: Series = 0.0
    tau_N: Series = 0.0
    damping: Damping = Damping()


class Running(NamedTuple):
    """What the force of a ship's actuators may depend on: time [s], velocity, commands that arrive.

    ``given`` has the commands as they are given; ``part`` has those of each actuator, as shares of their
    largest ones; ``power`` is for each actuator the setting by which its force is scaled.
    """

    t: Series = 0.0
    u: Series = 0.0
    v: Series = 0.0
    r: Series = 0.0
    given: tuple[Series, ...] = ()
    part: tuple[Series, ...] = ()
    power: tuple[Series, ...] = ()


class Thrust(NamedTuple):
    """Forces X and Y [N] of each actuator, where they act (x, y) [m], and what their sum loses.

    ``gain`` is by which each counts in the sum; ``loss_*`` is the part of tau that is lost on each axis;
    ``dx`` and ``dy`` [m] is how far from the assumed point all of it acts. ``couple`` [N m] is the yaw
    moment of each beside that of its force; empty: none has any.
    """

    X: tuple[Number, ...] = ()
    Y: tuple[Number, ...] = ()
    x: tuple[Number, ...] = ()
    y: tuple[Number, ...] = ()
    gain: tuple[Number, ...] = ()
    loss_X: Number = 0.0
    loss_Y: Number = 0.0
    loss_N: Number = 0.0
    dx: Number = 0.0
    dy: Number = 0.0
    couple: tuple[Number, ...] = ()


class EachSignal(NamedTuple):
    """What an effect with a memory does to each of its signals, by itself.

    Attributes:
        move: ``move(before, wanted, *parameters, h, turns)``: the signal after a step of h [s] towards
            the wanted one, and its mean over the step.
        places: of the signals.
        turns: for each whether it is an angle that goes round.
    """

    move: Callable[..., tuple[Number, Number]]
    places: tuple[int, ...]
    turns: tuple[bool, ...]


class Memory(NamedTuple):
    """How an actuator effect depends on the past.

    Attributes:
        initial: the memory before anything was commanded, nested tuples of floats; or a function that
            makes it for so many signals.
        of: the signals that it changes: commands on their way to the thrusters, or the shares of
            full force that the thrusters give.
        lasts: ``lasts(*parameters)``: time [s] after which what was commanded before no longer matters.
        keeps: how many steps of the past it holds; None: as many as there are.
        idle: ``idle(memory, signals)``: the memory after a step in which the effect does not act, from
            which it starts if it is switched on; by default it stays as it is.
        filter: ``filter(h, *parameters)``: numerator and denominator in 1/z of the linear filter that
            the effect is in steps of h [s], of unit gain for constant signals; None: it is none. Of an
            angle that goes round it holds while the way to the wanted one is less than half a turn.
        own: places of the signals that it changes.
        each: the effect where its memory is the signals themselves, moved one by one; None: it is not.
    """

    initial: tuple[object, ...] | Callable[[int], tuple[object, ...]]
    of: Literal["command", "force"]
    lasts: Callable[..., Number]
    keeps: int | None = None
    idle: Callable[[Any, tuple[Number, ...]], tuple[object, ...]] | None = None
    filter: Callable[..., tuple[Sequence[float], Sequence[float]]] | None = None
    own: slice = slice(None)
    each: EachSignal | None = None

    def start(self, width: int) -> tuple[object, ...]:
        """The memory before anything was commanded, of thrusters with ``width`` commands."""
        return self.initial(width) if callable(self.initial) else self.initial


Values = Mapping[str, float]


@dataclass(frozen=True)
class Search:
    """How an identification finds the parameters of an effect.

    Attributes:
        by: ``regression`` on the model error, a peak in its ``spectrum``, or ``given``: not looked for.
        differentiable: whether the force may be linearised about zero; by default, if it is linear.
        tries: values to try of the parameters that the force is not linear in, each a mapping from
            parameter to value; or a function that makes them of the parameters of the model in use. The
            best is refined afterwards. An effect that is neither differentiable nor has any is tried at
            multiples of a value of each coefficient, at which its force is as large as the model error.
            It is refined in all parameters but settings.
        fitted: parameters that are fitted by regression at each value tried; by default all
            coefficients of a differentiable effect, else none.
        intervals: start and end [s] of each interval of a run in which the effect acts, of which there
            may be any number up to these, at other times in each run. Segmentation finds them, as the
            fit has no slope by them. An end without a name is that of the run.
        lasting: id of the effect that is the same as one interval without an end.
        smooth: whether the coefficients are values of a curve at equally spaced nodes, of which
            neighbours are similar.
        of_each_run: whether its values may be others in each run, as of weather, load and sensors.
    """

    by: Literal["regression", "spectrum", "given"] = "regression"
    differentiable: bool | None = None
    tries: Iterable[Values] | Callable[[Values], Iterable[Values]] = ()
    fitted: tuple[str, ...] | None = None
    intervals: tuple[tuple[str, str], ...] = ()
    lasting: str = ""
    smooth: bool = False
    of_each_run: bool = False

    @property
    def times(self) -> tuple[str, ...]:
        """Parameters that are times within a run [s]."""
        return tuple(name for pair in self.intervals for name in pair if name)

    def values(self, nominal: Values) -> list[Values]:
        """The values to try, for a model with these parameters."""
        return list(self.tries(nominal) if callable(self.tries) else self.tries)


@dataclass(frozen=True)
class Wording:
    """How a finding is put into words.

    Attributes:
        sentence: the finding in one sentence, from a :class:`~fmus.effects.text.Found`; by default the
            effect's description.
        family: effects of a kind, with the manoeuvre that brings them out.
        apart: id of another effect -> what to run to discriminate the two.
        pictures: curves to draw.
        measured: what to measure in place of estimating a value, as a part of a sentence, from that
            value and a function of names that gives the model's parameters.
    """

    sentence: Callable[[Any], str] | None = None
    family: Family = UNKNOWN
    apart: Mapping[str, str] = field(default_factory=dict)
    pictures: tuple[Picture, ...] = ()
    measured: Callable[[float, Callable[[str], float]], str] | None = None


@dataclass(frozen=True, eq=False)
class Effect:
    """One effect.

    Attributes:
        id: its name in scenarios, reports and results.
        kind: what it acts on, see the table above.
        axis: axes that its force acts on: X, Y, N, XY, XN, YN or XYN.
        description: one line for people.
        formula, symbol, sign, source: how it is written, what positive values do, where it is from.
        linear: whether the force is linear in the coefficients.
        parameters: its parameters, in the order of the function's arguments.
        function: the effect itself; None where no FMU has it, but the measurement system.
        settings: parameters that are given and never fitted.
        gives: a ``force``; ``water velocity``, body-fixed (u, v) [m/s, m/s]; or the name of the damping
            coefficient that it adds to.
        adds_to: parameter -> names of the ship's coefficients that it is added to; empty: the effect is
            no change of the description.
        needs: actuators that a ship must have for it, by their names.
        apart: whether it shows only where each of several units that may share commands has its own.
        usual: standard deviation of its coefficients among ships, as far as they are imperfections that
            every ship has to some degree, in their unit; 0: it is not such.
        memory: how it depends on the past; None: not at all.
        search, wording: see there.
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
    function: EffectFunction | None
    settings: frozenset[str] = frozenset()
    gives: str = "force"
    adds_to: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    needs: frozenset[str] = frozenset()
    memory: Memory | None = None
    search: Search = Search()
    wording: Wording = Wording()
    apart: bool = False
    usual: float = 0.0

    def __call__(self, *arguments: object) -> Any:
        """What the function gives."""
        assert self.function is not None
        return self.function(*arguments)

    @property
    def slug(self) -> str:
        """The id as a name of variables: ``X_absu_u`` for ``X_|u|u``."""
        named = re.sub(r"\|(\w)\|", r"abs\1_", self.id)
        return re.sub(r"\W+", "_", named).strip("_")

    @property
    def coefficients(self) -> tuple[str, ...]:
        """Names of the parameters that are zero where there is no effect."""
        return tuple(p.name for p in self.parameters if p.start == 0.0 and p.name not in self.settings)

    @property
    def shape_parameters(self) -> tuple[str, ...]:
        """Names of the parameters that say how the effect acts, not how strong it is."""
        return tuple(p.name for p in self.parameters if p.start != 0.0 and p.name not in self.settings)

    @property
    def differentiable(self) -> bool:
        """Whether the force may be linearised about zero."""
        return self.linear if self.search.differentiable is None else self.search.differentiable

    @property
    def fitted(self) -> tuple[str, ...]:
        """Parameters that a regression finds."""
        if self.search.fitted is not None:
            return self.search.fitted
        return self.coefficients if self.differentiable else ()

    def regressors(self, *at: object) -> list[Any]:
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
    **more: Any,
) -> Callable[[EffectFunction], Effect]:
    """Decorator that makes an effect of a function; its docstring's first line describes it.

    Args:
        id, kind, axis, formula, symbol, sign, source, linear, settings: see :class:`Effect`.
        more: further fields of :class:`Effect`: gives, adds_to, needs, apart, usual, memory, search,
            wording; and parameters, where the function does not declare them in its signature, with
            description.

    Raises:
        DeclarationError: unknown kind, axis or field, or a parameter without unit, description or start.
    """
    further = {"gives", "adds_to", "apart", "usual", "memory", "search", "wording"}
    if unknown := set(more) - further - {"needs", "parameters", "description"}:
        raise DeclarationError(f"{id}: an effect has no '{min(unknown)}'")

    def declare(function: EffectFunction) -> Effect:
        if kind not in get_args(Kind):
            raise DeclarationError(f"{id}: no kind '{kind}'; there are {', '.join(get_args(Kind))}")
        if not axis or not set(axis) <= set("XYN"):
            raise DeclarationError(f"{id}: the axis must be made of X, Y and N, not '{axis}'")
        lines = (more.get("description") or docstring(function)).strip().splitlines()
        if not lines:
            raise DeclarationError(f"{id}: the first line of the docstring describes the effect")
        if more.get("memory") is not None and kind != "actuator":
            raise DeclarationError(f"{id}: a memory is of an actuator, and the kind is '{kind}'")
        leading = 3 if more.get("memory") is not None else 2 if kind == "actuator" else 1
        parameters = more.get("parameters") or parameters_of(id, leading, function)
        how = frozenset(settings)
        strengths = [p.name for p in parameters if p.start == 0.0 and p.name not in how]
        if not strengths:
            raise DeclarationError(f"{id} needs a parameter that starts at 0, where it has no effect")
        search: Search = more.get("search", Search())
        named = {*how, *(search.fitted or ()), *search.times}
        strange = sorted(named - {p.name for p in parameters})
        if strange:
            raise DeclarationError(f"{id} has no parameter '{strange[0]}'")
        return Effect(
            id,
            kind,
            axis,
            lines[0],
            formula,
            symbol or ", ".join(strengths),
            sign,
            source,
            linear,
            parameters,
            function,
            how,
            needs=frozenset(more.get("needs", ())),
            **{name: value for name, value in more.items() if name in further},
        )

    return declare

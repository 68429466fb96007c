"""The force that a ship's model has beyond another one's, beside an FMU of neither.

What the diagnosis finds beside a foreign FMU is a change of a ship's model. :func:`addition` makes a
component of it that lies between the commands and that FMU: it gets the commands and the FMU's motion,
and gives the FMU its inputs, to which the force of the change is added,

    M' nu_dot'(s, tau') - M nu_dot(s, tau) - (M' - M) nu_dot,

s being the state, the strokes marking the changed model; nu_dot in the last term is that of the FMU
itself, over its last step. An acceleration input gets M^-1 of that.
"""

from collections.abc import Mapping, Sequence
from functools import partial
from typing import NamedTuple

from .declare import Component, Fields, Variable, bundle, flatten, group_of, packer, variables, width
from .frames import rotate_to_body, rotate_to_earth
from .hull import Triple, accelerated, inertia_force
from .ops import Number, atan2, cos, fmax, sqrt, where, wrap
from .ship import Ship
from .signals import Force, VelocityInCurrent
from .vessel.vessel import State, disturbed

POSE, VELOCITY = ("x", "y", "psi"), ("u", "v", "r")
FORCE, ACCELERATION = ("tau_X", "tau_Y", "tau_N"), ("u_dot", "v_dot", "r_dot")
LEAST = 1e-9  # s; keeps a division defined in a step of no length

# Part of a ship -> parameter -> value.
Values = Mapping[str, Mapping[str, float]]


class Line(NamedTuple):
    """A signal in SI as gain times an FMU's variable, and an offset."""

    gain: float
    offset: float = 0.0


class Last(NamedTuple):
    """The state of the FMU at the last step."""

    t: float = 0.0
    x: float = 0.0
    y: float = 0.0
    psi: float = 0.0
    u: float = 0.0
    v: float = 0.0
    r: float = 0.0
    begun: float = 0.0


class Params(NamedTuple):
    """All is fixed."""


FOUND = partial(Component, "found", "Findings added to an FMU", Params, hold_nonfinite=False)


def addition(
    of: Ship,
    before: Values,
    after: Values,
    stated: Mapping[str, Line | float],
    given: Mapping[str, Line],
    beside: Mapping[str, Line],
) -> Component:
    """The component.

    Args:
        of: the ship.
        before, after: parameters of its vessel and thrusters in the two models.
        stated: pose or velocity -> how the FMU tells it; a number: it stays the same.
        given: force or command -> how the FMU takes it.
        beside: force or acceleration -> how the FMU takes what acts beside all else; of an axis that is
            missing here, the force is added to that which is given.
    """
    drive, commands = of.thrusters, variables(of.thrusters.inputs)[: -width(VelocityInCurrent)]
    hulls = [of.vessel.prepared(_params(of.vessel, v["vessel"])) for v in (before, after)]
    plants = [_params(drive, v["thrusters"]) for v in (before, after)]
    drives = [drive.prepared(p) for p in plants]
    start = packer(drive.inputs)([v.start for v in variables(drive.inputs)])
    columns = [name for name, line in stated.items() if isinstance(line, Line)]
    inputs = group_of(
        "Inputs",
        [*commands, *(Variable(f"from_{name}", "1", f"{name} of the FMU", 0.0) for name in columns)],
    )
    wires = [(f"to_{name}", line) for name, line in given.items()]
    wires += [(f"add_{name}", line) for name, line in beside.items()]
    outputs = group_of("Outputs", [Variable(n, "1", "to the FMU", 0.0) for n, _ in wires])
    state = bundle(
        "State", Last, before=drive.init(start, plants[0]), after=drive.init(start, plants[1])
    )
    acts = [v.name for v in variables(drive.outputs)].index("tau_act_X")

    def init(i: Fields, p: Params) -> Fields:
        return state()

    def moving(s: Fields, i: Fields, h: Number) -> tuple[State, Triple]:
        """The FMU's state, and its acceleration over the last step."""
        raw = dict(zip(columns, flatten(i)[len(commands) :], strict=True))
        now = {n: x.gain * raw[n] + x.offset if isinstance(x, Line) else x for n, x in stated.items()}
        short, begun = fmax(h, LEAST), (s.begun > 0.5) & (h > LEAST)
        if not all(n in now for n in POSE):
            dx, dy = rotate_to_earth(s.psi, now["u"], now["v"])
            now |= {"x": s.x + h * dx, "y": s.y + h * dy, "psi": s.psi + h * now["r"]}
        if not all(n in now for n in VELOCITY):
            u, v = rotate_to_body(now["psi"], (now["x"] - s.x) / short, (now["y"] - s.y) / short)
            rates = (u, v, wrap(now["psi"] - s.psi) / short)
            now |= {n: where(begun, x, 0.0) for n, x in zip(VELOCITY, rates, strict=True)}
        pairs = zip((now[n] for n in VELOCITY), (s.u, s.v, s.r), strict=True)
        nu_dot = [where(begun, (a - b) / short, 0.0) for a, b in pairs]
        ship = State(now["x"], now["y"], now["psi"], now["u"], now["v"], now["r"], s.t)
        return ship, (nu_dot[0], nu_dot[1], nu_dot[2])

    def step(s: Fields, i: Fields, p: Params, h: Number) -> tuple[Fields, Fields]:
        ship, nu_dot = moving(s, i, h)
        given_now = flatten(i)[: len(commands)]
        asked = packer(drive.inputs)([*given_now, ship.u, ship.v, ship.r, 0.0, 0.0])
        forces, pasts = [], []
        for hull, b, past in zip(hulls, drives, (s.before, s.after), strict=True):
            past, out = drive.advance(past, asked, b, h)
            tau = Force(*flatten(out)[acts : acts + 3])
            forces.append(inertia_force(*disturbed(ship, tau, hull), hull.hull.inertia))
            pasts.append(past)
        heavier = [inertia_force(*nu_dot, hull.hull.inertia) for hull in hulls]
        more = [b - a - (d - c) for a, b, c, d in zip(*forces, *heavier, strict=True)]
        faster = accelerated(hulls[0].hull.inverse, *more)
        signals = dict(zip((v.name for v in commands), given_now, strict=True))
        for axis, name in enumerate(FORCE):
            if name in signals and not {name, ACCELERATION[axis]} & beside.keys():
                signals[name] = signals[name] + more[axis]
        signals |= _polar(signals, given)
        extra = dict(zip((*FORCE, *ACCELERATION), (*more, *faster), strict=True))
        values = [(signals[n] - x.offset) / x.gain for n, x in given.items()]
        values += [(extra[n] - x.offset) / x.gain for n, x in beside.items()]
        x, y, psi, u, v, r, t = ship
        new = Last(t + h, x, y, psi, u, v, r, 1.0)
        kept = [where(h > LEAST, a, b) for a, b in zip(new, s, strict=False)]
        return state(*kept, *pasts), outputs(*values)

    return FOUND(state, inputs, outputs, init, step)


class AddedTerm(NamedTuple):
    """A force on one input of an FMU, as a function of one of its outputs.

    Attributes:
        input, output: their numbers.
        power: 0: constant; else of the output, with its sign.
        rate: whether it is a function of the output's derivative by time.
        coefficient: in units of both.
        turn: angle by the output, whose cosine then takes its place [rad by its unit]; 0: none.
        phase: of the cosine [rad].
    """

    input: int
    output: int
    power: int
    rate: bool
    coefficient: float
    turn: float = 0.0
    phase: float = 0.0


def added_terms(starts: Sequence[float], outputs: int, terms: Sequence[AddedTerm]) -> Component:
    """Inputs of an FMU with forces added to them; what it gets is what acts over the next step.

    Args:
        starts: start value of each input.
        outputs: number of outputs that forces are functions of.
        terms: the forces.
    """
    n = len(starts)
    inputs = group_of(
        "Inputs",
        [
            *(Variable(f"to_{k}", "1", "input without the forces", x) for k, x in enumerate(starts)),
            *(Variable(f"from_{k}", "1", "output of the FMU", 0.0) for k in range(outputs)),
        ],
    )
    given = group_of("Outputs", [Variable(f"sum_{k}", "1", "to the FMU", 0.0) for k in range(n)])
    names = [*(f"last_{k}" for k in range(outputs)), "begun"]
    state = group_of("State", [Variable(name, "1", "of the last step", 0.0) for name in names])

    def init(i: Fields, p: Params) -> Fields:
        return packer(state)([0.0] * len(names))

    def step(s: Fields, i: Fields, p: Params, h: Number) -> tuple[Fields, Fields]:
        values, before = flatten(i), flatten(s)
        sums, seen, begun = [*values[:n]], values[n:], (before[-1] > 0.5) & (h > LEAST)
        for slot, place, power, rate, coefficient, turn, phase in terms:
            y = seen[place] if power else 1.0
            if rate:
                y = where(begun, (y - before[place]) / fmax(h, LEAST), 0.0)
            y = cos(turn * y + phase) if turn else y
            size = 1.0
            for _ in range(power - 1):
                size = size * abs(y)
            sums[slot] = sums[slot] + coefficient * y * size
        new = [where(h > LEAST, a, b) for a, b in zip([*seen, 1.0], before, strict=True)]
        return packer(state)(new), packer(given)(sums)

    return FOUND(state, inputs, given, init, step)


def _polar(signals: Mapping[str, Number], given: Mapping[str, Line]) -> dict[str, Number]:
    """Size and angle from ahead to starboard of the forces that are given so, by their components."""
    found = {}
    for name in (n.removesuffix("_force") for n in given if n.endswith("_force")):
        if f"{name}_X" in signals and f"{name}_Y" in signals:
            ahead, aside = signals[f"{name}_X"], signals[f"{name}_Y"]
            found[f"{name}_force"] = sqrt(ahead * ahead + aside * aside)
            found[f"{name}_angle"] = atan2(aside, ahead)
    return found


def _params(component: Component, values: Mapping[str, float]) -> Fields:
    declared = variables(component.params)
    return packer(component.params)([float(values.get(v.name, v.start)) for v in declared])

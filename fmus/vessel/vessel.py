"""The hull of a ship in surge, sway and yaw, (2.1)-(2.9), and what acts on it.

Integrated by the classical fourth-order Runge-Kutta method with the force held over the step; a
communication step above 0.02 s is divided. A force input that is NaN or infinite acts as zero. Every
model effect on the hull, from outside, or in the measurement is off until a parameter says otherwise.
"""

from collections.abc import Callable, Sequence
from operator import add
from typing import Annotated, Any, NamedTuple, TypeVar

from ..declare import (
    FIXED,
    Component,
    Fields,
    Variable,
    bundle,
    group_of,
    parameters_of,
    redeclared,
    variables,
)
from ..effects import EffectSet, Loaded, Motion
from ..frames import air_velocity, rotate_to_earth
from ..hull import (
    Damping,
    Hull,
    Inertia,
    RotationalDamping,
    Terms,
    Triple,
    coriolis_force,
    damping_force,
    inertia_force,
    inverse_mass,
    motion,
    rotational_damping_force,
    term_variable,
)
from ..hull_functions import FUNCTIONS
from ..ops import Condition, Number, Series, finite, when, wrap
from ..ship_description import GUESSED, Description, Part, Value
from ..signals import Force, ForceInWind, Measurement, VelocityInCurrent
from .vessel_effects import NONE, VesselEffects, forces_of, vessel_effects


class VesselStart(NamedTuple):
    """State at the start of the simulation."""

    x_0: Annotated[float, "m", "initial north position", FIXED] = 5.0
    y_0: Annotated[float, "m", "initial east position", FIXED] = 2.0
    psi_0: Annotated[float, "rad", "initial heading", FIXED] = 0.0
    u_0: Annotated[float, "m/s", "initial surge velocity", FIXED] = 0.0
    v_0: Annotated[float, "m/s", "initial sway velocity", FIXED] = 0.0
    r_0: Annotated[float, "rad/s", "initial yaw rate", FIXED] = 0.0


# eta, nu over ground, and time.
State = Motion
B = TypeVar("B", Hull, "PreparedVessel")
# (state, force, what is known of the ship) -> nu_dot [m/s2, m/s2, rad/s2]
Acceleration = Callable[[State, Any, Any], Sequence[Series]]


class Pose(NamedTuple):
    x: Annotated[float, "m", "north position"] = 0.0
    y: Annotated[float, "m", "east position"] = 0.0
    psi: Annotated[float, "rad", "heading, from north towards east, continuous over turns"] = 0.0


class Outputs(NamedTuple):
    """Outputs of every vessel; behind them come the forces of its effects."""

    pose: Pose = Pose()
    velocity: VelocityInCurrent = VelocityInCurrent()
    u_dot: Annotated[float, "m/s2", "surge acceleration"] = 0.0
    v_dot: Annotated[float, "m/s2", "sway acceleration"] = 0.0
    r_dot: Annotated[float, "rad/s2", "yaw acceleration"] = 0.0
    measured: Measurement = Measurement()
    omega_X: Annotated[float, "N", "all model error in surge"] = 0.0
    omega_Y: Annotated[float, "N", "all model error in sway"] = 0.0
    omega_N: Annotated[float, "N.m", "all model error in yaw"] = 0.0
    omega_star_X: Annotated[float, "N", "model error of the control model (2.27) in surge"] = 0.0
    omega_star_Y: Annotated[float, "N", "model error of the control model (2.27) in sway"] = 0.0
    omega_star_N: Annotated[float, "N.m", "model error of the control model (2.27) in yaw"] = 0.0


def hull(p: Fields, effects: VesselEffects) -> Hull:
    """The hull with the changes of its damping and inertia applied."""
    inertia = p.inertia
    for member in effects.inertia.members:
        inertia = member.apply(member.acting(p.heavier), p.heavier, inertia, inertia)
    terms, functions = p.damping
    damping = Damping(type(terms)._make(map(add, terms, p.change)), functions)
    return Hull(inertia, inverse_mass(inertia), damping)


class PreparedVessel(NamedTuple):
    """What follows from the parameters alone: the hull, and which effects act.

    Attributes:
        params: the vessel's parameters.
        effects: of the vessel.
        hull: with all changes applied.
        changes, outside, measurement: for each effect of the group, whether it acts.
        flows: whether the water moves.
        changed, disturbed, heavier: whether a damping coefficient is changed, anything from outside or a
            current acts, the inertia is changed.
    """

    params: Fields
    effects: VesselEffects
    hull: Hull
    changes: tuple[Condition, ...]
    outside: tuple[Condition, ...]
    measurement: tuple[Condition, ...]
    flows: Condition
    changed: Condition
    disturbed: Condition
    heavier: Condition


def prepared(p: Fields, effects: VesselEffects) -> PreparedVessel:
    """Everything that a step needs of the parameters."""
    flows = effects.water.any_acts(p.water)
    return PreparedVessel(
        p,
        effects,
        hull(p, effects),
        effects.changes.acting(p.change),
        effects.outside.acting(p.outside),
        effects.measurement.acting(p.measurement),
        flows,
        effects.changes.any_acts(p.change),
        effects.outside.any_acts(p.outside) | flows,
        effects.inertia.any_acts(p.heavier),
    )


def through_water(s: State, b: PreparedVessel) -> tuple[Motion, Number, Number]:
    """The ship as the water sees it, and the water's body-fixed velocity [m/s, m/s]."""
    u_c: Number = 0.0
    v_c: Number = 0.0
    for member in b.effects.water.members:
        du, dv = member.effect(s, *b.params.water[member.parameters])
        u_c, v_c = u_c + du, v_c + dv
    return s._replace(u=s.u - u_c, v=s.v - v_c), u_c, v_c


def water_velocity(s: State, b: PreparedVessel) -> tuple[Number, Number]:
    """The water's body-fixed velocity [m/s, m/s]; zero at once where it does not move."""
    return when(b.flows, lambda: through_water(s, b)[1:], lambda: (0.0, 0.0))


def blown(b: PreparedVessel, s: State, W_n: Number, W_e: Number) -> PreparedVessel:
    """The vessel in a wind that is measured, beside the one of its parameters, and drives the water.

    Args:
        b: the vessel; one that takes no measured wind stays as it is.
        s: its state, at whose place the water moves.
        W_n, W_e: velocity of the air over ground [m/s].
    """
    k = b.effects.wind
    if k < 0:
        return b
    params = b.params._replace(water=b.params.water._replace(air_n=W_n, air_e=W_e))
    c_n, c_e = rotate_to_earth(s.psi, *water_velocity(s, b._replace(params=params)))
    at = b.params.outside
    params = params._replace(outside=at._replace(W_n=at.W_n + W_n - c_n, W_e=at.W_e + W_e - c_e))
    outside = tuple([True if k == j else acts for j, acts in enumerate(b.outside)])
    return b._replace(params=params, outside=outside, disturbed=True)


def _known_wind(b: PreparedVessel, s: State, W_n: Number, W_e: Number) -> Triple:
    """Force of the wind that is measured alone [N, N, N m], which the nominal model has as well."""
    member = b.effects.outside.members[b.effects.wind]
    at = b.params.outside._replace(W_n=W_n, W_e=W_e)
    return member.apply(True, at, NONE, s)


def nominal(s: State, tau: Force, b: Hull) -> Triple:
    """nu_dot [m/s2, m/s2, rad/s2] where nothing acts but the thrusters and still water."""
    return motion(s[3], s[4], s[5], tau, b)


def disturbed(s: State, tau: Force, b: PreparedVessel) -> Triple:
    """nu_dot [m/s2, m/s2, rad/s2] with every effect, in a current that the hull sees as nu_r."""
    ship, u_c, v_c = through_water(s, b)
    X, Y, N = tau
    loaded = Loaded(*ship, *tau, b.hull.damping)
    for member, acts in zip(b.effects.outside.members, b.outside, strict=True):
        dX, dY, dN = member.apply(acts, b.params.outside, NONE, loaded)
        X, Y, N = X + dX, Y + dY, N + dN
    u_dot, v_dot, r_dot = motion(ship.u, ship.v, ship.r, Force(X, Y, N), b.hull)
    # A constant current turns backwards in the turning ship's frame.
    return u_dot + s.r * v_c, v_dot - s.r * u_c, r_dot


def integrate(s: State, tau: object, b: object, h: Number, law: Acceleration = nominal) -> State:
    """State after h [s] of constant force by one step of the classical Runge-Kutta method.

    The law gives nu_dot from state, force and b: :func:`nominal` with b a Hull, :func:`disturbed` with
    b a Prepared.
    """
    x, y, psi, u, v, r, t = s
    half = 0.5 * h
    x1, y1 = rotate_to_earth(psi, u, v)
    u1, v1, r1 = law(s, tau, b)
    psi2, u2, v2, r2 = psi + half * r, u + half * u1, v + half * v1, r + half * r1
    x2, y2 = rotate_to_earth(psi2, u2, v2)
    du2, dv2, dr2 = law(State(x + half * x1, y + half * y1, psi2, u2, v2, r2, t + half), tau, b)
    psi3, u3, v3, r3 = psi + half * r2, u + half * du2, v + half * dv2, r + half * dr2
    x3, y3 = rotate_to_earth(psi3, u3, v3)
    du3, dv3, dr3 = law(State(x + half * x2, y + half * y2, psi3, u3, v3, r3, t + half), tau, b)
    psi4, u4, v4, r4 = psi + h * r3, u + h * du3, v + h * dv3, r + h * dr3
    x4, y4 = rotate_to_earth(psi4, u4, v4)
    du4, dv4, dr4 = law(State(x + h * x3, y + h * y3, psi4, u4, v4, r4, t + h), tau, b)
    sixth = h / 6.0
    return State(
        x + sixth * (x1 + 2.0 * (x2 + x3) + x4),
        y + sixth * (y1 + 2.0 * (y2 + y3) + y4),
        psi + sixth * (r + 2.0 * (r2 + r3) + r4),
        u + sixth * (u1 + 2.0 * (du2 + du3) + du4),
        v + sixth * (v1 + 2.0 * (dv2 + dv3) + dv4),
        r + sixth * (r1 + 2.0 * (dr2 + dr3) + dr4),
        t + h,
    )


def change_forces(s: State, b: PreparedVessel) -> Fields:
    """The force of each change of a damping coefficient."""
    ship, _, _ = through_water(s, b)
    forces = forces_of(b.effects.changes, b.changes, b.params.change, ship)
    return b.effects.change_forces._make(forces)


def outside_forces(s: State, tau: Force, b: PreparedVessel) -> Fields:
    """The force of each other effect on the hull."""
    ship, _, _ = through_water(s, b)
    forces = forces_of(
        b.effects.outside, b.outside, b.params.outside, Loaded(*ship, *tau, b.hull.damping)
    )
    return b.effects.outside_forces._make(forces)


def model_error(s: State, nu_dot: Triple, tau: Force, p: Fields) -> Triple:
    """omega [N, N, N m]: what the nominal model lacks of the force on the hull, (2.36)."""
    MX, MY, MN = inertia_force(*nu_dot, p.inertia)
    CX, CY, CN = coriolis_force(s.u, s.v, s.r, p.inertia)
    DX, DY, DN = damping_force(s.u, s.v, s.r, p.damping)
    return MX + CX - DX - tau[0], MY + CY - DY - tau[1], MN + CN - DN - tau[2]


def measured(s: State, b: PreparedVessel) -> Measurement:
    """The pose as the measurement system sees it."""
    pose = (s.x, s.y, s.psi)
    for member, acts in zip(b.effects.measurement.members, b.measurement, strict=True):
        pose = member.apply(acts, b.params.measurement, pose, pose)
    return Measurement(pose[0], pose[1], wrap(pose[2]))


def moved(
    s: State, tau: Force, b: B, h: Number, law: Callable[[State, Force, B], Triple]
) -> tuple[State, Triple]:
    """The state after h [s], and nu_dot there."""
    after = integrate(s, tau, b, h, law)
    return after, law(after, tau, b)


def described(ship: Description) -> tuple[Fields, Fields, Fields]:
    """Inertia, damping and start of a described ship, with where their values come from."""
    given = ship.values()

    groups_of = {v.name: v.known.group for v in variables(Inertia) if v.known is not None}

    def valued(v: Variable) -> Variable:
        start = given.get(v.name, Value(v.name, 0.0, GUESSED, 0.0))
        return start.of(v, groups_of.get(v.name, "damping"))

    own = [v.name for v in variables(Terms)]
    further = [term_variable(v.name) for v in ship.terms if v.name not in own]
    terms = group_of("Terms", map(valued, [*variables(Terms), *further]))()
    functions = bundle(
        "HullFunctions", None, **{part.law: _function(part)() for part in ship.functions}
    )()
    start = redeclared(VesselStart, ship.scale.of)()
    return redeclared(Inertia, valued)(), bundle("Damping", terms=terms, functions=functions)(), start


def _function(part: Part) -> type[Fields]:
    """Parameters of a function of the hull, as a description gives them."""
    given = {v.name: v for v in part.values}
    declared = parameters_of(part.law, 3, FUNCTIONS[part.law])
    return group_of(
        part.law, [given[v.name].of(v, "damping") if v.name in given else v for v in declared]
    )


def make(effects: EffectSet, ship: Description) -> Component:
    """The FMU of the vessel with some effects, each off until a parameter says otherwise.

    Args:
        effects: that it has.
        ship: whose hull it is.
    """
    inertia, damping, start = described(ship)
    windy = ship.wind_measured
    inputs: type[Any] = ForceInWind if windy else Force
    groups = vessel_effects(effects, type(damping), windy)
    unchanged, undisturbed = groups.change_forces(), groups.outside_forces()
    params = bundle(
        "Params",
        inertia=inertia,
        damping=damping,
        change=groups.changes.params(),
        outside=groups.outside.params(),
        water=groups.water.params(),
        heavier=groups.inertia.params(),
        measurement=groups.measurement.params(),
        start=start,
    )
    outputs = bundle("Outputs", Outputs, change=unchanged, outside=undisturbed)

    def init(i: Fields, p: Fields) -> State:
        return State(*p.start)

    def prepare(p: Fields) -> PreparedVessel:
        return prepared(p, groups)

    def prepared_step(s: State, i: Fields, b: PreparedVessel, h: Number) -> tuple[State, Fields]:
        p = b.params
        tau = Force(finite(i.tau_X, 0.0), finite(i.tau_Y, 0.0), finite(i.tau_N, 0.0))
        wind: tuple[Number, ...] = ()
        if windy:
            wind = air_velocity(finite(i.wind_speed, 0.0), finite(i.wind_direction, 0.0))
            b = blown(b, s, *wind)
        after, nu_dot = when(
            b.disturbed,
            lambda: moved(s, tau, b, h, disturbed),
            lambda: moved(s, tau, b.hull, h, nominal),
        )
        wrong = b.changed | b.disturbed | b.heavier
        known = Force(*map(add, tau, _known_wind(b, after, *wind))) if wind else tau
        omega = when(wrong, lambda: model_error(after, nu_dot, known, p), lambda: NONE)
        change = when(b.changed, lambda: change_forces(after, b), lambda: unchanged)
        outside = when(b.disturbed, lambda: outside_forces(after, tau, b), lambda: undisturbed)
        phi = [getattr(p.damping.terms, name) for name in RotationalDamping._fields]
        _, phi_Y, phi_N = rotational_damping_force(after.v, after.r, RotationalDamping._make(phi))
        u_dot, v_dot, r_dot = nu_dot
        omega_X, omega_Y, omega_N = omega
        return after, outputs(
            Pose(after.x, after.y, after.psi),
            VelocityInCurrent(after.u, after.v, after.r, *water_velocity(after, b)),
            u_dot,
            v_dot,
            r_dot,
            measured(after, b),
            omega_X,
            omega_Y,
            omega_N,
            omega_X,
            omega_Y + phi_Y,
            omega_N + phi_N,
            change,
            outside,
        )

    def step(s: State, i: Fields, p: Fields, h: Number) -> tuple[State, Fields]:
        return prepared_step(s, i, prepare(p), h)

    return Component(
        name="vessel",
        description=f"Hull of {ship.title} in surge, sway and yaw",
        params=params,
        state=State,
        inputs=inputs,
        outputs=outputs,
        init=init,
        step=step,
        sampled=False,
        max_step=0.02 * ship.scale.time,
        hold_nonfinite=False,
        prepare=prepare,
        prepared_step=prepared_step,
        outline=ship.drawn,
    )

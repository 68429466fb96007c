"""Autopilot: heading by a PID law with a reference model, speed by a PI law; no force in sway.

For ships that cannot push sideways (T. I. Fossen, Handbook of Marine Craft Hydrodynamics and Motion
Control, 2nd ed., Wiley, 2021, ch. 15). The heading wanted passes a reference model of third order,

    psi_d''' + (2 zeta + 1) w psi_d'' + (2 zeta + 1) w^2 psi_d' + w^3 psi_d = w^3 psi_t,

whose rate settles at no more than ``r_max``: the error that drives it is limited, so nothing winds up.
The moment is feed-forward of the reference, by yaw inertia m and damping d of the controller model, and

    tau_N = m w^2 (psi_d - psi) + (2 zeta w m - d) (r_d - r) + integral,

which gives the closed loop the natural frequency w and the damping ratio zeta, unless the hull alone
damps more. The speed wanted is the target's velocity along its heading; it passes a reference model of
first order, and the surge force is feed-forward and a PI law of the same kind.

Frequencies and rates are in prime units, as manoeuvring coefficients are: w' = w L / U, with L the
length between perpendiculars and U the speed, of those wanted and estimated the larger one, and at
least ``u_least``. As forces of hull, rudder and propeller go with U^2, the same numbers give ships of
all sizes at all speeds the same track in their lengths; inertia and damping are given.

Waves move the heading faster than a rudder should. With ``omega_wave``, the frequency at which they are
met, the feedback of heading and rate passes a notch filter (Fossen 2021, ch. 13),

    (s^2 + 2 zeta_wave omega_wave s + omega_wave^2) / (s + omega_wave)^2,

which leaves the share ``zeta_wave`` of them there, and slow motion as it is.

The integrals follow the force that acts where the thrusters tell it (anti-windup by back-calculation).
The references start from the ship's own heading, rate and speed, so there is no jolt at the start; a
ship that is nearer to the speed wanted than its reference takes that along.

An input that is NaN or infinite keeps its last finite value.
"""

from typing import Annotated, NamedTuple

from ..actuators.steering import steerable
from ..declare import POSITIVE, Component, Fields, Range, component, group_of, variables
from ..effects import EffectSet
from ..frames import rotate_to_body
from ..hull import Damping, Inertia, mass_matrix
from ..ops import Number, clip, cos, exp, fmax, sin, where, wrap
from ..scale import REFERENCE_LENGTH
from ..ship_description import Description
from ..signals import Force, Target
from ..sizing import sized
from .backstepping import HELD, Demand, Errors, Inputs, acting
from .commanding import commanding

FREQUENCY = Range(0.01, 100.0)
RATIO = Range(0.1, 10.0)
OWN_AXIS = ("X_u", "X_absu_u", "X_uuu", "N_r", "N_absr_r")
KnownDamping = group_of("KnownDamping", [v for v in variables(Damping) if v.name in OWN_AXIS])


class Params(NamedTuple):
    omega_psi_prime: Annotated[float, "1", "natural frequency of the heading, prime", FREQUENCY] = 2.0
    zeta_psi: Annotated[float, "1", "damping ratio of the heading", RATIO] = 1.0
    omega_u_prime: Annotated[float, "1", "natural frequency of the speed, prime", FREQUENCY] = 0.6
    zeta_u: Annotated[float, "1", "damping ratio of the speed", RATIO] = 1.0
    integral: Annotated[
        float, "1", "integral gain of the heading, over natural frequency and K_P", Range(0.0, 1.0)
    ] = 0.1
    omega_d_prime: Annotated[
        float, "1", "natural frequency of the heading reference, prime", FREQUENCY
    ] = 1.8
    zeta_d: Annotated[float, "1", "damping ratio of the heading reference", RATIO] = 1.0
    r_max_prime: Annotated[
        float, "1", "rate at which the heading reference settles, prime", Range(0.001, 10.0)
    ] = 0.5
    omega_u_d_prime: Annotated[float, "1", "pole of the speed reference, prime", FREQUENCY] = 0.4
    length: Annotated[float, "m", "length between perpendiculars, of prime units", Range(0.1)] = (
        REFERENCE_LENGTH
    )
    u_least: Annotated[float, "m/s", "lower limit of the speed in prime units", Range(0.001, 10.0)] = 0.1
    inertia: Inertia = Inertia()
    damping: Fields = KnownDamping()
    omega_wave: Annotated[float, "rad/s", "encounter frequency of the waves; 0: no filter", POSITIVE] = (
        0.0
    )
    zeta_wave: Annotated[float, "1", "share of the waves that passes the filter", Range(0.0, 1.0)] = 0.1


class Tuning(NamedTuple):
    """Frequencies and rates of the present speed [rad/s]."""

    omega_psi: Number
    omega_u: Number
    omega_d: Number
    r_max: Number
    omega_u_d: Number


class HeadingReference(NamedTuple):
    """Heading [rad], yaw rate [rad/s], yaw acceleration, and speed [m/s] to be held."""

    psi: Number = 0.0
    r: Number = 0.0
    r_dot: Number = 0.0
    u: Number = 0.0


class Notch(NamedTuple):
    """The feedback through one low pass and through two [N.m.s, N.m.s2]."""

    once: Number = 0.0
    twice: Number = 0.0


class State(NamedTuple):
    """Reference, integral parts of surge force and yaw moment [N, N m], last force, wave filter."""

    reference: HeadingReference = HeadingReference()
    surge: Number = 0.0
    yaw: Number = 0.0
    tau: Force = Force()
    notch: Notch = Notch()


class Outputs(NamedTuple):
    demand: Demand = Demand()
    psi_d: Annotated[float, "rad", "heading reference, continuous over turns"] = 0.0
    r_d: Annotated[float, "rad/s", "yaw rate reference"] = 0.0
    r_d_dot: Annotated[float, "rad/s2", "yaw acceleration reference"] = 0.0
    u_d: Annotated[float, "m/s", "speed reference"] = 0.0


def wanted_speed(t: Target) -> Number:
    """Velocity of the target along its own heading [m/s]."""
    return t.x_t_dot * cos(t.psi_t) + t.y_t_dot * sin(t.psi_t)


def tuning(i: Inputs, p: Params) -> Tuning:
    """The prime numbers at the speed wanted, or the estimated one if that is larger."""
    U = fmax(fmax(abs(wanted_speed(i.target)), abs(i.estimate.u_hat)), p.u_least)
    unit = U / p.length  # of rates, U / L [1/s]
    return Tuning(
        p.omega_psi_prime * unit,
        p.omega_u_prime * unit,
        p.omega_d_prime * unit,
        p.r_max_prime * unit,
        p.omega_u_d_prime * unit,
    )


def follow(d: HeadingReference, i: Inputs, p: Params, at: Tuning, h: Number) -> HeadingReference:
    """The reference after h [s]."""
    t, own, w = i.target, i.estimate.u_hat, at.omega_d
    k = 2.0 * p.zeta_d + 1.0
    most = k * at.r_max / w  # the error at which the rate settles at r_max
    error = clip(wrap(t.psi_t - d.psi), -most, most)
    jerk = w * (w * (w * error - k * d.r) - k * d.r_dot)
    r_dot = d.r_dot + h * jerk
    r = d.r + h * r_dot
    speed = wanted_speed(t)
    before = where((h > 0.0) & ((own - d.u) * (speed - own) > 0.0), own, d.u)  # the ship is ahead of it
    return HeadingReference(d.psi + h * r, r, r_dot, before + h * at.omega_u_d * (speed - before))


def feedback(d: HeadingReference, i: Inputs, p: Params, at: Tuning) -> Number:
    """K_P (psi_d - psi) + K_D (r_d - r) [N m]."""
    _, _, (_, _, m_r) = mass_matrix(p.inertia)
    K_D = fmax(2.0 * p.zeta_psi * at.omega_psi * m_r + p.damping.N_r, 0.0)
    K_P = m_r * at.omega_psi * at.omega_psi
    return K_P * wrap(d.psi - i.estimate.psi_hat) + K_D * (d.r - i.estimate.r_hat)


def filtered(n: Notch, moment: Number, p: Params, h: Number) -> Notch:
    """The wave filter after h [s] of a moment that is held."""
    w = where(p.omega_wave > 0.0, p.omega_wave, 1.0)
    decay, end = exp(-w * h), moment / w
    return Notch(
        end + (n.once - end) * decay,
        n.twice * decay + end / w * (1.0 - decay) + (n.once - end) * h * decay,
    )


def without_waves(n: Notch, moment: Number, p: Params) -> Number:
    """The moment behind the wave filter."""
    w = p.omega_wave
    return moment - 2.0 * (1.0 - p.zeta_wave) * w * (n.once - w * n.twice)


def law(s: State, i: Inputs, p: Params, at: Tuning) -> Outputs:
    """The force of a state, and what it is made of."""
    e, t, d, c = i.estimate, i.target, s.reference, p.damping
    (m_u, _, _), _, (_, _, m_r) = mass_matrix(p.inertia)
    turn, r, u = wrap(d.psi - e.psi_hat), d.r - e.r_hat, d.u - e.u_hat
    K_P_u = fmax(2.0 * p.zeta_u * at.omega_u * m_u + c.X_u, 0.0)
    lX = m_u * at.omega_u_d * (wanted_speed(t) - d.u) + K_P_u * u + s.surge
    lN = m_r * d.r_dot + without_waves(s.notch, feedback(d, i, p, at), p) + s.yaw
    nX = 0.0 - (c.X_u + c.X_absu_u * abs(d.u) + c.X_uuu * d.u * d.u) * d.u
    nN = 0.0 - (c.N_r + c.N_absr_r * abs(d.r)) * d.r
    ahead, aside = rotate_to_body(e.psi_hat, e.x_hat - t.x_t, e.y_hat - t.y_t)
    errors = Errors(ahead, aside, 0.0 - turn, 0.0 - u, e.v_hat, 0.0 - r)
    force = Force(lX + nX, 0.0, lN + nN)
    return Outputs(
        Demand(force, lX, 0.0, lN, nX, 0.0, nN, errors, 0.0 - s.surge, 0.0, 0.0 - s.yaw),
        d.psi,
        d.r,
        d.r_dot,
        d.u,
    )


def init(i: Inputs, p: Params) -> State:
    e = i.estimate
    s = State(HeadingReference(e.psi_hat, e.r_hat, 0.0, e.u_hat))
    return s._replace(tau=law(s, i, p, tuning(i, p)).demand.tau)


def step(s: State, i: Inputs, p: Params, h: Number) -> tuple[State, Outputs]:
    e, at = i.estimate, tuning(i, p)
    d = follow(s.reference, i, p, at, h)
    acted = acting(i.applied, s.tau)
    (m_u, _, _), _, (_, _, m_r) = mass_matrix(p.inertia)
    w_u, w = at.omega_u, at.omega_psi
    K_I_u, K_I = m_u * w_u * w_u, p.integral * w * m_r * w * w
    seen = where(e.frozen > 0.5, 0.0, h)  # of a frozen measurement nothing adds up
    s = State(
        d,
        s.surge + seen * (K_I_u * (d.u - e.u_hat) + w_u * (acted.tau_X - s.tau.tau_X)),
        s.yaw + seen * (K_I * wrap(d.psi - e.psi_hat) + w * (acted.tau_N - s.tau.tau_N)),
        s.tau,
        filtered(s.notch, feedback(d, i, p, at), p, h),
    )
    out = law(s, i, p, at)
    asked = Force(*[where(h > 0.0, new, old) for new, old in zip(out.demand.tau, s.tau, strict=True)])
    return s._replace(tau=asked), out


COMPONENT = component(
    name="controller_heading",
    description="Autopilot: heading and speed, without force in sway",
    init=init,
    step=step,
    held=HELD,
)


def make(effects: EffectSet, ship: Description) -> Component | None:
    """The autopilot of a ship.

    Where thrusters get commands in place of a force, it gives these; None: none of them steers.
    """
    autopilot = sized(COMPONENT, ship)
    if ship.allocates:
        return autopilot
    return commanding(autopilot, ship) if steerable(ship) else None

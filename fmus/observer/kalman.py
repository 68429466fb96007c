"""Kalman filter with the model of the hull: velocity and acceleration without differentiating.

Estimated are eta, nu and on each body axis a disturbance of the acceleration: what the model does not
explain, from a wrong damping coefficient to thrust that never came. The acceleration follows from the
model, (2.2), halfway through the step, and the disturbance. The innovation is turned to body axes,
where the axes part (see :mod:`.axis`); their covariances grow while the measurement is frozen or lost
(see :mod:`.screen`), so that the first sample thereafter counts for more.

A sample far off is a spike and left out, until so many follow that the ship must really be there. Lost
for longer than ``rest_time``, the model is left too and the velocity fades, because the nominal hull is
unstable above 0.04 m/s. A force that is NaN or infinite counts as zero.
"""

from typing import Annotated, NamedTuple

from ..declare import Range, component
from ..frames import rotate_to_body, rotate_to_earth
from ..hull import Damping, Hull, Inertia, inverse_mass, motion
from ..ops import Condition, Number, choose, clip, exp, finite, fmax, when, where
from ..signals import Estimate, Force
from .axis import MOST, DisturbedAxis, LearningRates, NoiseLearning, later, rates, taken
from .correction import MotionState
from .derivative import Acceleration
from .screen import Inputs, ScreenedSample, Screening, Seen, first_look, limited, look

STD = Range(1e-6, 1.0)


class KalmanNoise(NamedTuple):
    """Noise of the measurement, and what the slope of a disturbance gains in a second at least."""

    position_std: Annotated[float, "m", "standard deviation of a measured position", STD] = 0.0002
    heading_std: Annotated[float, "rad", "standard deviation of a measured heading", STD] = 0.0003
    drift_u: Annotated[float, "m/s3", "growth in 1 s of the slope in surge", STD] = 0.000024
    drift_v: Annotated[float, "m/s3", "growth in 1 s of the slope in sway", STD] = 0.000024
    drift_r: Annotated[float, "rad/s3", "growth in 1 s of the slope in yaw", STD] = 0.000048


class Rejection(NamedTuple):
    """What is rejected, and what is done without measurements."""

    gate: Annotated[float, "1", "standard deviations beyond which a sample is a spike", Range(1.0)] = 5.0
    position_slack: Annotated[float, "m", "standard deviation added before that", STD] = 0.005
    heading_slack: Annotated[float, "rad", "standard deviation added before that", STD] = 0.01
    jump_time: Annotated[
        float, "s", "spikes for a longer time are a jump of the position", Range(0.0)
    ] = 0.3
    fade_time: Annotated[float, "s", "time constant of a velocity long lost", Range(0.01)] = 0.2


class Params(NamedTuple):
    noise: KalmanNoise = KalmanNoise()
    learning: NoiseLearning = NoiseLearning()
    rejection: Rejection = Rejection()
    screening: Screening = Screening()
    inertia: Inertia = Inertia()
    damping: Damping = Damping()


class KalmanState(NamedTuple):
    """Pose and velocity, and what is known on each body axis."""

    motion: MotionState = MotionState()
    surge: DisturbedAxis = DisturbedAxis()
    sway: DisturbedAxis = DisturbedAxis()
    yaw: DisturbedAxis = DisturbedAxis()


class State(NamedTuple):
    seen: Seen = Seen()
    estimate: KalmanState = KalmanState()
    acceleration: Acceleration = Acceleration()
    refused: Number = 0.0


def predicted(
    s: State, tau: Force, hull: Hull, keep: Number, h: Number
) -> tuple[MotionState, Acceleration]:
    """Pose and velocity after h [s] of a force, and nu_dot by the model alone.

    This is the midpoint method, halfway by the old acceleration; it needs the model once a step. Where
    only a share of the velocity is kept, nothing is known of its change.
    """
    (x, y, psi, u, v, r), surge, sway, yaw = s.estimate
    u_dot, v_dot, r_dot = s.acceleration
    half = 0.5 * h
    um, vm, rm = u + half * u_dot, v + half * v_dot, r + half * r_dot
    X, Y, N = motion(um, vm, rm, tau, hull)
    x_dot, y_dot = rotate_to_earth(psi + half * r, um, vm)
    gain = where(keep < 1.0, 0.0, h)
    return MotionState(
        x + h * x_dot,
        y + h * y_dot,
        psi + h * rm,
        clip(keep * u + gain * (X + surge.d), -MOST, MOST),
        clip(keep * v + gain * (Y + sway.d), -MOST, MOST),
        clip(keep * r + gain * (N + yaw.d), -MOST, MOST),
    ), Acceleration(X, Y, N)


def before_sample(
    s: State, ahead: MotionState, keep: Number, p: Params, k: LearningRates, h: Number
) -> KalmanState:
    """The estimate after h [s], before the sample of that instant."""
    _, surge, sway, yaw = s.estimate
    n = p.noise
    return when(
        keep < 1.0,
        # Long lost, nothing is known any more but that a ship comes to rest.
        lambda: KalmanState(
            ahead,
            DisturbedAxis(keep * surge.d),
            DisturbedAxis(keep * sway.d),
            DisturbedAxis(keep * yaw.d),
        ),
        lambda: KalmanState(
            ahead,
            later(surge, n.drift_u, k, h),
            later(sway, n.drift_v, k, h),
            later(yaw, n.drift_r, k, h),
        ),
    )


def corrected(
    b: KalmanState, s: ScreenedSample, p: Params, k: LearningRates
) -> tuple[KalmanState, Condition]:
    """The estimate after a sample, and whether the sample fits to the one before."""
    m, n, rejection = b.motion, p.noise, p.rejection
    ahead, aside = rotate_to_body(m.psi, s.x - m.x, s.y - m.y)
    turn = s.psi - m.psi
    position, heading = n.position_std * n.position_std, n.heading_std * n.heading_std
    surge, dx, du = taken(b.surge, ahead, position, k)
    sway, dy, dv = taken(b.sway, aside, position, k)
    yaw, dpsi, dr = taken(b.yaw, turn, heading, k)
    x, y = rotate_to_earth(m.psi, dx, dy)
    after = MotionState(
        m.x + x,
        m.y + y,
        m.psi + dpsi,
        clip(m.u + du, -MOST, MOST),
        clip(m.v + dv, -MOST, MOST),
        clip(m.r + dr, -MOST, MOST),
    )
    slack = position + rejection.position_slack * rejection.position_slack
    distance = (
        ahead * ahead / (slack + b.surge.covariance.pp)
        + aside * aside / (slack + b.sway.covariance.pp)
        + turn
        * turn
        / (heading + rejection.heading_slack * rejection.heading_slack + b.yaw.covariance.pp)
    )
    return KalmanState(after, surge, sway, yaw), distance <= rejection.gate * rejection.gate


def init(i: Inputs, p: Params) -> State:
    seen = first_look(i.measurement)
    return State(seen, KalmanState(MotionState(seen.x_m, seen.y_m, seen.psi_m)))


def step(s: State, i: Inputs, p: Params, h: Number) -> tuple[State, Estimate]:
    tau = limited(i.tau)
    hull = Hull(p.inertia, inverse_mass(p.inertia), p.damping)
    period = p.screening.measurement_period
    k = rates(p.learning, period, h)
    keep = where(s.seen.age > p.screening.rest_time, exp(-h / p.rejection.fade_time), 1.0)
    ahead, model = predicted(s, tau, hull, keep, h)
    before = before_sample(s, ahead, keep, p, k, h)
    seen, sample = look(s.seen, i.measurement, before.motion.psi, p.screening, h)
    # A sample that is held until the next measurement tells nothing new.
    new = sample.good & ((seen.age <= 0.0) | sample.overdue) & (h > 0.0)
    after, fitting = corrected(before, sample, p, k)
    fits = new & fitting
    refused = where(fits, 0.0, where(new, s.refused + fmax(h, period), s.refused))
    elsewhere = sample.first | (refused > p.rejection.jump_time)
    estimate = when(
        elsewhere,
        lambda: KalmanState(MotionState(sample.x, sample.y, finite(sample.psi, 0.0))),
        lambda: choose(fits, after, before),
    )
    m = estimate.motion
    known = Acceleration(
        where(sample.overdue, 0.0, clip(model.u_dot + estimate.surge.d, -MOST, MOST)),
        where(sample.overdue, 0.0, clip(model.v_dot + estimate.sway.d, -MOST, MOST)),
        where(sample.overdue, 0.0, clip(model.r_dot + estimate.yaw.d, -MOST, MOST)),
    )
    state = State(seen, estimate, choose(h > 0.0, known, s.acceleration), where(elsewhere, 0.0, refused))
    frozen = where(sample.good, 0.0, 1.0)
    return state, Estimate(m.x, m.y, m.psi, m.u, m.v, m.r, *known, frozen)


COMPONENT = component(
    name="observer_kalman",
    description="Kalman filter with the model of the hull and an estimated disturbance",
    init=init,
    step=step,
    hold_nonfinite=False,
    held=("tau_X", "tau_Y", "tau_N"),
)

"""An optimal fixed-point smoother of stored samples, 8.1 and 6.5 (after Chowdhary et al., 2012).

A sample need not be stored at once: what is measured after its instant j tells more of it. On each
axis of the earth-fixed pose runs a steady Kalman filter of position p, velocity v and a slow disturbance
d, in

    p' = v,   v' = R(psi) (M^-1 (tau + known) + S(r) nu) + d,   d' = white noise,

where what is known of the hull and the force is given. Beside it the state of instant j is corrected by
each later innovation e,

    x_j' = Sigma C^T e,   Sigma' = Sigma (A - K C)^T,   Sigma(j) = P,

which is Kalman's filter of the state with x_j added to it. With the covariance in units of that of the
measurement, its bandwidth w [rad/s] is all that is to be chosen: K = (2 w, 2 w^2, w^3), poles of
Butterworth. After the span T = 6/w, Sigma has fallen to e^-3 of P and x_j is taken as final.
"""

from typing import NamedTuple

from ..frames import rotate_to_body, rotate_to_earth
from ..hull import Triple, accelerated, inverse_mass
from ..ops import Condition, Number, choose, fmax, when
from .parametrisation import B, Parametrisation
from .smoothing import LearningSample

# w T; w h stays below this part of 1, so that a step is short compared with the filter.
SETTLES = 6.0
FAST = 0.5
STILL = (0.0, 0.0, 0.0)
SOON = 1e-9  # s; a time or an age that has begun


class FilteredAxis(NamedTuple):
    """Position, velocity and disturbance of one axis."""

    p: Number = 0.0
    v: Number = 0.0
    d: Number = 0.0


Axes = tuple[FilteredAxis, FilteredAxis, FilteredAxis]
AXES = (FilteredAxis(), FilteredAxis(), FilteredAxis())


class FixedPoint(NamedTuple):
    """The filter, how long it has run [s], and the sample that is being smoothed, of age ``age`` [s]."""

    axes: Axes = AXES
    ran: Number = 0.0
    age: Number = 0.0
    time: Number = 0.0
    tau: Triple = STILL
    driven: Triple = STILL
    smooth: Axes = AXES
    sigma: tuple[Triple, Triple, Triple] = (STILL, STILL, STILL)


class Now(NamedTuple):
    """What a step brings: time [s], estimated pose and velocity, force that acted."""

    time: Number
    pose: Triple
    nu: Triple
    tau: Triple


def covariance(w: Number) -> tuple[Triple, Triple, Triple]:
    """P of the steady filter of bandwidth w [rad/s]; its first column is the gain K."""
    w2 = w * w
    w3 = w2 * w
    return (
        (2.0 * w, 2.0 * w2, w3),
        (2.0 * w2, 3.0 * w3, 2.0 * w3 * w),
        (w3, 2.0 * w3 * w, 2.0 * w3 * w2),
    )


def later(sigma: tuple[Triple, Triple, Triple], K: Triple, h: Number) -> tuple[Triple, Triple, Triple]:
    """Sigma after h [s] with the gain K."""
    a, b, c = K
    i, j, k = [(x + h * (y - a * x), y + h * (z - b * x), z - h * c * x) for x, y, z in sigma]
    return i, j, k


def driving(
    model: Parametrisation[B], psi: Number, nu: Triple, tau: Triple, controller_model: B
) -> Triple:
    """Earth-fixed acceleration [m/s2, m/s2, rad/s2] by the force and what is known of the hull."""
    u, v, r = nu
    kX, kY, kN = model.known(u, v, r, controller_model)
    a, b, c = accelerated(inverse_mass(controller_model.inertia), tau[0] + kX, tau[1] + kY, tau[2] + kN)
    x, y = rotate_to_earth(psi, a - r * v, b + r * u)
    return x, y, c


def body(axes: tuple[FilteredAxis, FilteredAxis, FilteredAxis], driven: Triple) -> tuple[Triple, Triple]:
    """Velocity and acceleration along the ship."""
    x, y, turn = axes
    u, v = rotate_to_body(turn.p, x.v, y.v)
    a, b = rotate_to_body(turn.p, driven[0] + x.d, driven[1] + y.d)
    r = turn.v
    return (u, v, r), (a + r * v, b - r * u, driven[2] + turn.d)


def begun(now: Now) -> FixedPoint:
    """The filter at its first instant, with the observer's velocity."""
    x_dot, y_dot = rotate_to_earth(now.pose[2], now.nu[0], now.nu[1])
    x, y, psi = now.pose
    return FixedPoint(
        (FilteredAxis(x, x_dot), FilteredAxis(y, y_dot), FilteredAxis(psi, now.nu[2])), SOON
    )


def advanced(
    model: Parametrisation[B],
    controller_model: B,
    s: FixedPoint,
    now: Now,
    span: Number,
    h: Number,
    usable: Condition,
) -> tuple[FixedPoint, LearningSample, Condition]:
    """The smoother after a step of h [s].

    Args:
        model: of which what is known is used.
        controller_model: about the hull.
        s: before.
        now: what the step brought.
        span: how long a sample is smoothed [s].
        h: the step [s].
        usable: False where nothing may be learned, or nothing is measured: everything begins anew. An
            observer that finds the ship again after a freeze is wrong for longer than the freeze.

    Returns:
        The smoother, a sample, and True where that is final and to be stored.
    """
    w = SETTLES / fmax(span, SETTLES / FAST * h)
    P = covariance(w)
    K = P[0]

    def stepped() -> tuple[FixedPoint, LearningSample, Condition]:
        turn = s.axes[2]
        u, v = rotate_to_body(turn.p, s.axes[0].v, s.axes[1].v)
        push = driving(model, turn.p, (u, v, turn.v), now.tau, controller_model)
        axes, smooth = [], []
        for axis, old, pushed, measured in zip(s.axes, s.smooth, push, now.pose, strict=True):
            rate = pushed + axis.d
            ahead = axis.p + h * (axis.v + 0.5 * h * rate)
            e = h * (measured - ahead)
            axes.append(FilteredAxis(ahead + K[0] * e, axis.v + h * rate + K[1] * e, axis.d + K[2] * e))
            (a, _, _), (b, _, _), (c, _, _) = s.sigma
            smooth.append(FilteredAxis(old.p + a * e, old.v + b * e, old.d + c * e))
        going, fixed = (axes[0], axes[1], axes[2]), (smooth[0], smooth[1], smooth[2])
        age, ran = s.age + h, s.ran + h
        nu, nu_dot = body(fixed, s.driven)
        sample = LearningSample(s.time, fixed[2].p, nu, nu_dot, s.tau)
        done = (s.age > 0.0) & (age >= span)
        after = FixedPoint(going, ran, age, s.time, s.tau, s.driven, fixed, later(s.sigma, K, h))
        # The next one begins where the filter has settled and none is under way.
        psi = going[2].p
        a, b = rotate_to_body(psi, going[0].v, going[1].v)
        drive = driving(model, psi, (a, b, going[2].v), now.tau, controller_model)
        fresh = FixedPoint(going, ran, SOON, now.time, now.tau, drive, going, P)
        idle = FixedPoint(going, ran)
        settled = ran >= span
        begins = settled & (done | (s.age <= 0.0))
        return choose(begins, fresh, choose(s.age > 0.0, after, idle)), sample, done

    def restarted() -> tuple[FixedPoint, LearningSample, Condition]:
        return choose(usable, begun(now), FixedPoint()), LearningSample(), False

    return when(usable & (s.ran > 0.0), stepped, restarted)

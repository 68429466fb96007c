"""Tells that a thruster has lost force: which, since when, how sure; 7.2.5 and Fig. 7.3.

The model error omega = M nu' + C(nu)nu + D(nu)nu - tau of the whole hull, low-passed so that no
acceleration is needed, is written as the forces g that the thrusters seem to give too much. What of g is
usual for a velocity and a command is learned by recursive least squares from samples that are older than
a window. In the window, a thruster that lost a share s of its force f leaves g = -s f of its own: its
likelihood ratio, the largest over s and over the time of the failure, is divided by its mean so far
(which is 1 for white noise) and held against the odds of a failure. While one is reported, nothing is
learned.

The inputs are those of a controller; ``tau_cmd`` must be connected. The target is not used.
"""

from collections.abc import Callable, Sequence
from typing import Annotated, NamedTuple

from ..actuators.actuation import actuators, parameters
from ..actuators.attack import Attack, attacking
from ..actuators.weighted_allocation import axes, components, solution
from ..controller.backstepping import HELD, Inputs, acting
from ..controller.eigen import dot
from ..controller.models import FullControllerModel, everything
from ..declare import POSITIVE, Component, Fields, Range, Variable, bundle, group_of
from ..effects import EffectSet
from ..hull import inertia_force
from ..ops import Number, choose, clip, exp, fmax, fmin, log, sqrt, when, where
from ..ship_description import Description
from ..signals import Force
from ..sizing import sized

Triple = tuple[Number, Number, Number]

ROWS = 20  # of the window
LEAST_ROWS = 4  # since the failure, before it is reported
AXES = ((0, 1), (2,))  # of the forces, those of each of the two thrusters
COUNT = 7  # regressors of what is usual: 1, u, v, r, and the forces of the three thrusters
STILL: Triple = (0.0, 0.0, 0.0)
# Prior standard deviations of what is usual [N per 1, m/s, m/s, rad/s, N, N, N]; chosen: a hull and
# thrusters that differ from their model by as much as Table 7.1 says.
SPREAD = (0.3, 3.0, 3.0, 2.0, 0.4, 0.4, 0.4)
START = 5.0  # s of judging that the first values of mean square and ratios count for (chosen)
HUBER = 3.0  # standard deviations that a single sample counts for at the most (chosen)
NOISE = 0.05  # N; of g before anything is known; chosen: what a millimetre of noise gives
NEVER_SURE = 40.0  # largest logarithm of odds, so that no exponential overflows


class Settings(NamedTuple):
    filter_time: Annotated[float, "s", "time constant of the low pass", Range(0.01)] = 1.0
    sample_time: Annotated[float, "s", "between samples of the window of 20", Range(0.01)] = 0.5
    memory: Annotated[float, "s", "time over which the usual level is learned", Range(1.0)] = 120.0
    first: Annotated[float, "s", "time of judging before a failure is reported", POSITIVE] = 30.0
    least_loss: Annotated[
        float, "1", "thrust level below which no loss is reported", Range(0.0, 1.0)
    ] = 0.15
    # One in ten hours: chosen.
    failure_rate: Annotated[float, "1/s", "expected rate of failures", Range(1e-12)] = 2.8e-5


class Detection(NamedTuple):
    """Probability that each of two thrusters has failed, since when [s], and the share of its force."""

    failed: tuple[Number, Number] = (0.0, 0.0)
    since: Number = 0.0
    lost: tuple[Number, Number] = (0.0, 0.0)


def outputs_of(ship: Description) -> type[Fields]:
    """The outputs of the detector of a ship."""

    def each(stem: str, text: str) -> list[Variable]:
        return [
            Variable(f"{stem}_{a.part.name}", "1", text.format(a.part.title), 0.0)
            for a in actuators(ship)
        ]

    since = Variable("since", "s", "start of the reported failure; 0: none", 0.0)
    failed = each("failed", "probability that the {} failed, 0...1")
    return group_of(
        "Outputs", [*failed, since, *each("lost", "estimated lost share of the force of the {}")]
    )


class WatchedSample(NamedTuple):
    """A sample of the window: time [s], velocity, commanded forces of the thrusters [N], what they seem
    to give too much [N], how far that was from the usual, its variance over that of the noise (what is
    usual is not sure where the ship has never been), the likelihood ratios then, and whether enough had
    been learned for these to count."""

    filled: Number = 0.0
    time: Number = 0.0
    nu: Triple = STILL
    f: Triple = STILL
    g: Triple = STILL
    error: Triple = STILL
    unsure: Number = 1.0
    ratios: tuple[Number, Number] = (1.0, 1.0)
    fair: Number = 0.0


class Usual(NamedTuple):
    """What is usual: covariance of the regressors' weights over the noise, weights of each g, mean
    square error of the prediction, mean likelihood ratios, how long was learned, and judged [s]."""

    P: tuple[tuple[Number, ...], ...] = tuple(
        [
            tuple([(SPREAD[i] / NOISE) ** 2 if i == j else 0.0 for j in range(COUNT)])
            for i in range(COUNT)
        ]
    )
    weights: tuple[tuple[Number, ...], ...] = ((0.0,) * COUNT,) * 3
    square: Triple = (NOISE * NOISE, NOISE * NOISE, NOISE * NOISE)
    ratios: tuple[Number, Number] = (1.0, 1.0)
    learned: Number = 0.0
    judged: Number = 0.0


class State(NamedTuple):
    time: Number
    quiet: Number  # s since the last frozen measurement
    waited: Number  # s since the last sample
    nu: Triple
    rest: Triple
    f: Triple
    rows: tuple[WatchedSample, ...]
    usual: Usual
    stated: Detection


def init(i: Inputs, p: Fields) -> State:
    e = i.estimate
    nu = (e.u_hat, e.v_hat, e.r_hat)
    return State(0.0, 0.0, 0.0, nu, STILL, STILL, (WatchedSample(),) * ROWS, Usual(), Detection())


def low_pass(before: Triple, now: Triple, share: Number) -> Triple:
    a, b, c = [x + share * (y - x) for x, y in zip(before, now, strict=True)]
    return a, b, c


def regressors(nu: Triple, f: Triple) -> tuple[Number, ...]:
    return (1.0, *nu, *f)


def unusual(row: WatchedSample, usual: Usual) -> Triple:
    """g less what is usual [N]."""
    z = regressors(row.nu, row.f)
    a, b, c = [g - dot(w, z) for g, w in zip(row.g, usual.weights, strict=True)]
    return a, b, c


def learned(usual: Usual, old: WatchedSample, p: Fields) -> Usual:
    """What is usual, with one more sample, by recursive least squares that forgets."""
    z = regressors(old.nu, old.f)
    keep = exp(-p.sample_time / p.memory)
    Pz = [dot(line, z) for line in usual.P]
    total = keep + dot(z, Pz)
    gain = [x / total for x in Pz]
    # Weights that nothing is learned of become no less certain than they were at first.
    spread = sum([usual.P[k][k] for k in range(COUNT)])
    grow = where(spread < sum([(s / NOISE) ** 2 for s in SPREAD]), 1.0 / keep, 1.0)
    P = tuple(
        [tuple([(usual.P[i][j] - gain[i] * Pz[j]) * grow for j in range(COUNT)]) for i in range(COUNT)]
    )
    errors = unusual(old, usual)
    weights = tuple(
        [
            tuple([w + k * e for w, k in zip(line, gain, strict=True)])
            for line, e in zip(usual.weights, errors, strict=True)
        ]
    )
    judged = usual.judged + old.fair * p.sample_time
    share = old.fair * fmax(1.0 - keep, p.sample_time / (judged + START))
    # An error or a ratio that stands out counts as three standard deviations.
    squares = (*[e * e / old.unsure for e in old.error], *old.ratios)
    a, b, c, x, y = [
        m + share * (fmin(n, 9.0 * m) - m)
        for m, n in zip((*usual.square, *usual.ratios), squares, strict=True)
    ]
    return Usual(P, weights, (a, b, c), (x, y), usual.learned + p.sample_time, judged)


def evidence(
    rows: tuple[WatchedSample, ...], usual: Usual, axes: tuple[int, ...], least: Number
) -> tuple[Number, Number, Number, Number]:
    """Likelihood ratio of a loss on some of the axes of g: of the whole window, and the largest over the
    time of the failure, with the share lost and that time."""
    up, full, down, best, share, since = 0.0, 0.0, 1e-12, 0.0, 0.0, 0.0
    for k, row in enumerate(rows):
        error = unusual(row, usual)
        for axis in axes:
            deviation = sqrt(usual.square[axis] * row.unsure)
            e, f = error[axis] / deviation, row.filled * row.f[axis] / deviation
            up = up - f * clip(e, -HUBER, HUBER)
            full = full - f * e
            down = down + f * f
        if k + 1 >= LEAST_ROWS:
            ratio = where((full > least * down) & (up > 0.0), up * up / down, 0.0)
            better = ratio > best
            share = where(better, full / down, share)
            since = where(better, row.time, since)
            best = fmax(best, ratio)
    return up * up / down, best, share, since


def judged(
    rows: tuple[WatchedSample, ...], usual: Usual, p: Fields
) -> tuple[tuple[Number, Number], Detection]:
    """The likelihood ratios of the window, and what is reported."""
    found = [evidence(rows, usual, axes, p.least_loss) for axes in AXES]
    (whole_a, best_a, lost_a, since_a), (whole_b, best_b, lost_b, since_b) = found
    # A failure somewhere in the window, at any of its times.
    expected = p.failure_rate * p.sample_time
    against = -log(expected)
    odds = [
        exp(clip(0.5 * best / fmax(mean, 1.0) - against, -NEVER_SURE, NEVER_SURE))
        for best, mean in ((best_a, usual.ratios[0]), (best_b, usual.ratios[1]))
    ]
    ready = where(usual.judged >= p.first, 1.0, 0.0)
    a, b = [ready * x / (1.0 + odds[0] + odds[1]) for x in odds]
    since = where(a > b, since_a, since_b)
    stated = fmax(a, b) > 0.5
    return (whole_a, whole_b), Detection((a, b), where(stated, since, 0.0), (lost_a, lost_b))


def advanced(
    s: State, i: Inputs, p: Fields, h: Number, forces: Callable[[Sequence[Number]], Triple]
) -> tuple[State, Detection]:
    """The state after h [s]; ``forces(tau)``: the thrusters' forces [N] that give a force."""
    e = i.estimate
    nu = (e.u_hat, e.v_hat, e.r_hat)
    tau = acting(i.applied, Force())
    share = h / (h + p.filter_time)
    slow = low_pass(s.nu, nu, share)
    a, b, c = [(x - y) / p.filter_time for x, y in zip(nu, slow, strict=True)]
    moved = inertia_force(a, b, c, p.controller_model.inertia)
    known = everything(*nu, p.controller_model)
    rest = low_pass(s.rest, (known[0] + tau[0], known[1] + tau[1], known[2] + tau[2]), share)
    f = low_pass(s.f, forces(tau), share)
    quiet = where(e.frozen > 0.5, 0.0, s.quiet + h)
    waited = s.waited + h
    time = s.time + h
    # The low pass forgets a jump at the end of a freeze in a few time constants; times within rounding.
    ready = (waited > p.sample_time * (1.0 - 1e-9)) & (quiet > 2.0 * p.filter_time * (1.0 - 1e-9))
    due = (h > 0.0) & ready

    def sampled() -> tuple[tuple[WatchedSample, ...], Usual, Detection]:
        omega = (moved[0] - rest[0], moved[1] - rest[1], moved[2] - rest[2])
        old = s.rows[-1]
        calm = (s.stated.failed[0] < 0.5) & (s.stated.failed[1] < 0.5)
        usual = when((old.filled > 0.5) & calm, lambda: learned(s.usual, old, p), lambda: s.usual)
        row = WatchedSample(1.0, time, slow, f, forces(omega))
        z = regressors(slow, f)
        unsure = 1.0 + fmax(dot(z, [dot(line, z) for line in usual.P]), 0.0)
        row = row._replace(error=unusual(row, usual), unsure=unsure)
        ratios, stated = judged((row, *s.rows[:-1]), usual, p)
        fair = where(usual.learned > 0.5 * p.first, 1.0, 0.0)
        return (row._replace(ratios=ratios, fair=fair), *s.rows[:-1]), usual, stated

    rows, usual, stated = when(due, sampled, lambda: (s.rows, s.usual, s.stated))
    after = State(time, quiet, where(due, 0.0, waited), slow, rest, f, rows, usual, stated)
    return choose(h > 0.0, after, s), stated


def make(effects: EffectSet, ship: Description) -> Component | None:
    """The detector for a ship of two thrusters, the first of two components; None: it has others."""
    whose = tuple(
        [tuple([k for k, c in enumerate(components(ship)) if c.actuator is a]) for a in actuators(ship)]
    )
    if whose != AXES or len(axes(ship)) != len(components(ship)):
        return None
    known = {a.part.name: parameters(ship, a, "", False)() for a in actuators(ship)}
    params = bundle(
        "Params",
        Settings,
        controller_model=FullControllerModel(),
        allocation=bundle("Allocation", None, **known)(),
        attack=Attack(),
    )
    outputs = outputs_of(ship)

    def step(s: State, i: Inputs, p: Fields, h: Number) -> tuple[State, Fields]:
        values = attacking(p.allocation, p.attack)
        after, stated = advanced(s, i, p, h, lambda tau: solution(ship, tau, values))
        return after, outputs(*stated.failed, stated.since, *stated.lost)

    watch = Component(
        name="watch_thrusters",
        description="Detector of thrusters that lose force, by the model error",
        params=params,
        state=State,
        inputs=Inputs,
        outputs=outputs,
        init=init,
        step=step,
        held=HELD,
    )
    return sized(watch, ship)

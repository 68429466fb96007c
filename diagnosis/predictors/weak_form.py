"""The model error over windows, without ever forming an acceleration (weak form).

The equation of motion is multiplied with a smooth kernel w over a window and integrated; by parts, the
acceleration becomes the velocity times -dw/dt. What is left over is the force that the model lacks.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from scipy.sparse import csr_matrix

from fmus.declare import variables
from fmus.hull import accelerated
from fmus.scale import REFERENCE, Scale
from fmus.signals import Force
from fmus.vessel import vessel

from ..runs import Smoothed
from ..runs.cleaning import WIDTH
from ..runs.files.reading import Run
from ..runs.run_constants import BLOCK, BLOCKS, DIGITS, EVERY, HORIZON
from ..runs.smoothing.smoother import breaks
from ..runs.thinning import thinned_motion
from .prediction import at_rest, before_filters, true_motion
from .ship_model import Model
from .thrust import Response, inflow, thrust

# 1, windows of 3 s every 0.5 s overlap: so many carry as much as one that is independent. The
# correlations of the kernel (1 - s^2)^3 at shifts of 0.5 s sum to 3.7; rounded up. Seconds are those of
# CyberShip Enterprise 1, times the scale of the ship.
OVERLAP = 4.0

SMALL = 1e-3  # 1, of its usual size: step of a finite difference where nothing is linear; chosen
# bytes, for each part of the model error of a run that is remembered: commands that thrusters with a
# memory respond to, of 700 s with two sets of thrusters those of 15 such models.
ROOM = 4e7
OF_MOTION = ("motion", "change", "free", "met")  # parts that do not depend on commands


def kernel(s: np.ndarray) -> np.ndarray:
    """(1 - s^2)^3 of unit area over [-1, 1]."""
    return 35.0 / 32.0 * (1.0 - s * s) ** 3


def kernel_integral(s: np.ndarray) -> np.ndarray:
    return 35.0 / 32.0 * (s - s**3 + 0.6 * s**5 - s**7 / 7.0)


def kernel_moment(s: np.ndarray) -> np.ndarray:
    """Integral of s (1 - s^2)^3 of the kernel, zero at the ends."""
    return -35.0 / 256.0 * (1.0 - s * s) ** 4


@dataclass(frozen=True, eq=False, repr=False)
class WeakWindows:
    """The windows of one run that can be used, and the integrals over them.

    Attributes:
        smoothed: the run.
        middle: (K,) [s].
        block: (K,), number of the block that the middle lies in.
        smooth, slope, held: (K, n), integrals of w times a smooth signal, of -dw/dt times one, and of w
            times one that is held from each sample to the next. They are exact for signals that are
            straight between samples, however far apart these are.
        horizon: length of the windows in which models predict the run [s].
        memory: parts of the model error that were computed lately.
        whole: the run with all of its rows, where these are fewer; None: it has all.
    """

    smoothed: Smoothed
    middle: np.ndarray
    block: np.ndarray
    smooth: csr_matrix
    slope: csr_matrix
    held: csr_matrix
    horizon: float
    memory: dict[str, dict[Any, Any]] = field(default_factory=dict, repr=False)
    whole: Run | None = None

    def __repr__(self) -> str:
        time = self.run.time
        seconds, count = time[-1] - time[0], self.middle.size
        return f"<run {self.run.name}: {time.size} samples in {seconds:.6g} s, {count} windows>"

    @property
    def run(self) -> Run:
        return self.smoothed.track.run

    def commanded_as(self, run: Run) -> "WeakWindows":
        """The windows of a run that differs from this one in its commands alone.

        Both remember what does not depend on commands in one place.
        """
        memory = {part: self.memory.setdefault(part, {}) for part in OF_MOTION}
        track = replace(self.smoothed.track, run=run)
        return replace(self, smoothed=replace(self.smoothed, track=track), whole=None, memory=memory)

    @property
    def scale(self) -> Scale:
        """Of the ship."""
        return self.smoothed.scale

    @property
    def width(self) -> float:
        """Of a window [s]."""
        return WIDTH * self.scale.time

    @property
    def every(self) -> float:
        """From a window to the next [s]."""
        return EVERY * self.scale.time

    @cached_property
    def known(self) -> np.ndarray:
        """(n,), samples at which there is a smoothed state; the others have weight zero."""
        return np.all(np.isfinite(self.smoothed.nu), axis=1, keepdims=False)

    @cached_property
    def motion(self) -> tuple[np.ndarray, np.ndarray]:
        """Smoothed pose and velocity, each (n, 3); zero where they are not known."""
        eta, nu = (np.where(self.known[:, None], x, 0.0) for x in (self.smoothed.eta, self.smoothed.nu))
        return eta, nu

    @cached_property
    def thinned(self) -> "WeakWindows":
        """The windows with fewer rows, by which model errors are computed."""
        smoothed = thinned_motion(self.smoothed)
        if smoothed is self.smoothed:
            return self
        return replace(self._of_rows(smoothed, self.middle), whole=self.run)

    @cached_property
    def excerpt(self) -> "WeakWindows":
        """The windows at the beginning of each block where blocks are long, and the rows that they need.

        By these a long run is judged, in the time that one of BLOCKS short blocks takes.
        """
        time, length = self.run.time, BLOCK * self.scale.time
        _, first, number = np.unique(self.block, return_index=True, return_inverse=True)
        kept = self.middle - self.middle[first][number] < length - DIGITS
        if kept.all():
            return self
        middle, settles = self.middle[kept], self.smoothed.track.responded - time[0]
        # Half a window, and more for commands that are logged late and for actuators that are slow.
        last = np.searchsorted(middle, time + 2.0 * self.width + settles, side="right")
        needed = last > np.searchsorted(middle, time - self.width)
        return replace(self._of_rows(self.smoothed.rows(needed), middle), block=self.block[kept])

    def _of_rows(self, smoothed: Smoothed, middle: np.ndarray) -> "WeakWindows":
        """Windows of some middles (K,) [s] by the run with fewer rows."""
        smooth, slope, held = _integrals(smoothed.time, middle, 0.5 * self.width)
        rows = {"smooth": smooth, "slope": slope, "held": held}
        return replace(self, smoothed=smoothed, middle=middle, **rows, memory={})

    def recall(self, what: str, key: Any, make: Callable[[], np.ndarray]) -> np.ndarray:
        """A part of the model error, from memory if it was computed for the same parameters lately.

        Of two models that differ in the hull alone the thrust is the same, and so on.
        """
        kept = self.memory.setdefault(what, {})
        found = kept.pop(key, None)
        if found is None:
            found = make()
            while len(kept) * found.nbytes > ROOM:
                del kept[next(iter(kept))]
        kept[key] = found  # the last in order is the latest
        return found


def places(t: np.ndarray, scale: Scale = REFERENCE) -> np.ndarray:
    """Numbers of the windows that samples at times (n,) lie in: over a gap of years there are none."""
    width, every = WIDTH * scale.time, EVERY * scale.time
    last = np.floor((t[-1] - t[0] - width + DIGITS) / every)
    reach = np.ceil(width / 2 / every)
    near = np.unique(np.round((t - t[0] - width / 2) / every))
    found = np.unique(near[:, None] + np.arange(-reach, reach + 1.0))
    return found[(found >= 0.0) & (found <= last)]


def weak_windows(smoothed: Smoothed, horizon: float | None = None) -> WeakWindows:
    """The windows of a run with half of the samples or more, all commands, and thrusters at work.

    They begin where actuators that lag hardly follow commands from before the run any more.

    Args:
        smoothed: the run.
        horizon: length of the windows in which models predict it [s]; by default that of its ship.
    """
    run, scale = smoothed.track.run, smoothed.scale
    t, half = run.time, 0.5 * WIDTH * scale.time
    middles = t[0] + half + EVERY * scale.time * places(t, scale)
    first = np.searchsorted(t, middles - half, side="left")
    last = np.searchsorted(t, middles + half, side="right")
    count = last - first

    def number(rows: np.ndarray) -> np.ndarray:
        """(K,), in each window those of some rows (n,)."""
        sums = np.cumsum(np.concatenate([[0], rows]))
        return sums[last] - sums[first]

    # Stretches know nothing of each other: no window lies in two.
    parts = np.cumsum(np.concatenate([[0], breaks(np.arange(t.size), smoothed.track)]))
    whole = parts[np.maximum(first - 1, 0)] == parts[np.minimum(last, t.size - 1)]
    kept = (
        whole
        & (middles - half >= smoothed.track.responded - DIGITS)
        & (smoothed.track.silences[np.minimum(first, t.size - 1)] % 2 == 0)
        & (count > 3)
        & (number(~np.all(np.isfinite(smoothed.nu), axis=1, keepdims=False)) == 0)
        & (2 * number(smoothed.used | smoothed.track.between) >= count)
        & (number(np.abs(run.tau_cmd).max(axis=1) > 1e-6) > 0)
    )
    middles = middles[kept]
    block = np.floor((middles - t[0]) / max(BLOCK * scale.time, (t[-1] - t[0]) / BLOCKS)).astype(int)
    horizon = horizon or HORIZON * scale.time
    smooth, slope, held = _integrals(t, middles, half)
    return WeakWindows(smoothed, middles, block, smooth, slope, held, horizon)


def _integrals(t: np.ndarray, middles: np.ndarray, half: float) -> Iterator[csr_matrix]:
    """Smooth, slope and held of :class:`WeakWindows`, of times (n,), middles and half a width [s]."""
    # A window may begin and end between two samples.
    first = np.maximum(np.searchsorted(t, middles - half, side="left") - 1, 0)
    last = np.minimum(np.searchsorted(t, middles + half, side="right") + 1, t.size)
    rows = np.repeat(np.arange(middles.size), last - first)
    columns = np.concatenate([rows[:0], *map(np.arange, first, last)]).astype(np.int32)
    starts = np.concatenate([[0], np.cumsum(last - first)]).astype(np.int32)  # which the three share
    area, share, step = _span(t, middles[rows], half, columns)
    area_before, share_before, step_before = _span(t, middles[rows], half, columns - 1)
    weights = area - share + share_before, area_before / step_before - area / step, area
    shape = middles.size, t.size
    yield from (csr_matrix((values, columns, starts), shape=shape) for values in weights)


def _span(
    t: np.ndarray, middle: np.ndarray, half: float, row: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Of the time from a row to the next: the kernel's area, its part of the next row, and its length.

    Of rows (m,) of windows with middles (m,), times t (n,) [s]; outside of these there is no time.
    """
    a, b = t[np.maximum(row, 0)], t[np.minimum(row + 1, t.size - 1)]
    low, high = (np.clip((x - middle) / half, -1.0, 1.0) for x in (a, b))
    area = kernel_integral(high) - kernel_integral(low)
    step = np.where(b > a, b - a, 1.0)
    moment = half * (kernel_moment(high) - kernel_moment(low)) + (middle - a) * area
    return area, moment / step, step


def omega(w: WeakWindows, model: Model) -> np.ndarray:
    """omega (K, 3) [N, N, N m]: the force that the model lacks, averaged over each window.

    An acceleration counts as a force by the inertia of the model that this one was made from.
    """
    return _balance(w, model, thrust=True)


def needed_force(w: WeakWindows, model: Model) -> np.ndarray:
    """Force (K, 3) [N, N, N m] that a motion needs by a model's inertia and hull; 0 where not finite."""
    with np.errstate(all="ignore"):  # in a wrong unit forces may be beyond all numbers
        return np.nan_to_num(_balance(w, model, thrust=False), posinf=0.0, neginf=0.0)


def inertial(w: WeakWindows, model: Model) -> np.ndarray:
    """The part (K, 3) of the needed force that is not damping: M nu_dot + C nu [N, N, N m]."""
    return needed_force(w, undamped(model))


def undamped(model: Model) -> Model:
    """The model without damping of its hull."""
    none = {v.name: 0.0 for v in variables(type(model.hull.params.damping))}
    return replace(model, vessel=dict(model.vessel) | none)


def _balance(w: WeakWindows, model: Model, thrust: bool) -> np.ndarray:
    """The force that a motion needs, less that of the thrusters and what is given, if these count."""
    if w.run.name not in model.given:  # a force along a run has all of its rows
        w = w.thinned
    model = model.during(w.run.name)
    of_pose = model.ship.effects.of_kind("measurement")
    names = [p.name for e in of_pose if e.function is not None for p in e.parameters]
    # The ship is part of each key: two may have effects of one name that are different functions.
    values = (*((name, model.vessel.get(name, 0.0)) for name in names), model.filters)
    measured = (model.ship, values)
    ship = (measured, tuple(sorted(model.vessel.items())))
    water = model.hull.params.water
    drive = (measured, water, tuple(sorted(model.thrusters.items())), model.logging)
    eta, nu = w.recall("motion", measured, lambda: _motion(w, model))
    change = w.recall("change", measured, lambda: w.slope @ nu)
    free = w.recall("free", ship, lambda: w.smooth @ acceleration(model, w.smoothed, eta, nu))
    if not thrust:
        return (change - free) @ model.reference_mass.T

    def drives() -> np.ndarray:
        key = measured, water
        met = w.recall("met", key, lambda: halfway(w, inflow_along(w, model, eta, nu)))
        return w.held @ thrust_along(w, model, met)

    driven = _acting(w, model, w.recall("driven", drive, drives), eta, nu)
    return (change - free - by_mass(model, driven)) @ model.reference_mass.T


def modelled_force(w: WeakWindows, model: Model, nu: np.ndarray) -> np.ndarray:
    """Force (K, 3) [N, N, N m] of hull and thrusters over the windows, at the velocity nu (n, 3)."""
    model, (eta, _) = model.during(w.run.name), w.motion
    hull = w.smooth @ acceleration(model, w.smoothed, eta, nu) @ model.reference_mass.T
    driven = w.held @ thrust_along(w, model, halfway(w, inflow_along(w, model, eta, nu)))
    return hull + _acting(w, model, driven, eta, nu)


def _acting(
    w: WeakWindows, model: Model, driven: np.ndarray, eta: np.ndarray, nu: np.ndarray
) -> np.ndarray:
    """Force (K, 3) on the hull, for that of the thrusters over the windows, with what is given."""
    force = driven @ model.effective_thrust.T
    given = model.given.get(w.run.name)
    return force if given is None else force + w.smooth @ given.at(eta, nu)


def commanded(data: Sequence[WeakWindows], model: Model) -> np.ndarray:
    """Force (K, 3) [N, N, N m] by which a ship is moved, averaged over the windows of some runs.

    That is the commanded force; on an axis that is never commanded, as of a ship that cannot push
    sideways, what the model's inertia asks for the measured motion: in a turn m u r, and not only what
    changes v.
    """
    force = np.concatenate([w.held @ w.run.tau_cmd for w in data])
    idle = ~force.any(axis=0)
    if idle.any():
        force[:, idle] = np.concatenate([inertial(w, model) for w in data])[:, idle]
    return force


def common_commands(data: Sequence[WeakWindows]) -> tuple[str, ...]:
    """Signals of the commands of actuators in all runs; none: runs have others, or the force alone."""
    signals = {w.run.signals if w.run.commands is not None else () for w in data}
    return signals.pop() if len(signals) == 1 else ()


def inflow_along(w: WeakWindows, model: Model, eta: np.ndarray, nu: np.ndarray) -> np.ndarray:
    """Velocity (n, 3) with which a ship's thrusters meet the water, at its pose and velocity (n, 3)."""
    s = vessel.State._make([*eta.T, *nu.T, w.run.time])
    return np.column_stack(inflow(s, in_wind(model, w.smoothed, s)))


def thrust_along(w: WeakWindows, model: Model, nu: np.ndarray | None = None) -> np.ndarray:
    """tau (n, 3) [N, N, N m] of the model's thrusters from each sample of a run to the next.

    They meet the water with ``nu`` (n, 3); by default with that of the smoothed motion, halfway.
    """
    model = model.during(w.run.name)
    if nu is None:
        nu = halfway(w, inflow_along(w, model, *w.motion))
    return thrust(w.run, model, response(w, model), nu)


def halfway(w: WeakWindows, nu: np.ndarray) -> np.ndarray:
    """Velocity (n, 3) halfway from each sample to the next, at which a thruster's force is taken.

    A force that goes with speed, as a rudder's, would else come half a sampling period late.
    """
    middle = nu.copy()
    half = np.where(w.known[:-1] & w.known[1:], 0.5, 0.0)
    middle[:-1] += half[:, None] * np.diff(nu, axis=0)
    return middle


def arriving(w: WeakWindows, model: Model) -> np.ndarray:
    """Commands (k, n) that reach the model's thrusters, mean from each sample to the next."""
    return response(w, model)[0]


def response(w: WeakWindows, model: Model) -> np.ndarray:
    """What becomes of the commands of all rows, see :meth:`.thrust.Response.between`."""

    def between() -> np.ndarray:
        return Response(w.whole or w.run, model, not at_rest(w.smoothed)).between(w.run)

    return w.recall("response", Response.key(model), between)


def commanded_force(w: WeakWindows, model: Model) -> np.ndarray:
    """tau (n, 3) [N, N, N m] of a run's commands at rest, as late as the model's thrusters follow."""
    if not Response(w.run, model).slow:
        return w.run.tau_cmd
    return thrust_along(w, model, np.zeros_like(w.run.tau_cmd))


def acceleration(model: Model, run: Smoothed, eta: np.ndarray, nu: np.ndarray) -> np.ndarray:
    """nu_dot (n, 3) [m/s2, m/s2, rad/s2] of the hull without thrust, at its pose and velocity (n, 3).

    The wind is that of the run, where it was measured.
    """
    s = vessel.State._make([*eta.T, *nu.T, run.time])
    nu_dot = vessel.disturbed(s, Force(0.0, 0.0, 0.0), in_wind(model, run, s))
    return np.column_stack(np.broadcast_arrays(*nu_dot))


def in_wind(model: Model, run: Smoothed, s: vessel.State) -> vessel.PreparedVessel:
    """A model's vessel at states of a run, in the wind that was measured there."""
    return model.hull if run.air is None else vessel.blown(model.hull, s, *run.air.T)


def by_mass(model: Model, force: np.ndarray) -> np.ndarray:
    """M^-1 of a force (n, 3)."""
    X, Y, N = force.T
    return np.column_stack(accelerated(model.hull.hull.inverse, X, Y, N))


def _motion(w: WeakWindows, model: Model) -> np.ndarray:
    """True pose and velocity (2, n, 3) behind the measured ones."""
    eta, eta_dot = before_filters(w.smoothed, model)
    motion = true_motion(eta.T, eta_dot.T, model)
    # Columns in one piece each: all that is computed of them goes along time.
    return np.array([np.where(w.known, np.concatenate(part), 0.0) for part in motion]).swapaxes(1, 2)

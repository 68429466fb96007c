"""Filters of the pose that is measured: a low-pass, a tracker of constant velocity, a latency."""

from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from scipy.linalg import get_lapack_funcs

from fmus.ops import wrap

from ..runs import Smoothed
from ..runs.files.telegrams import groups_of


class Filters(NamedTuple):
    """Filters behind which x, y and psi are measured; zero: none.

    Attributes:
        lag: (3,), time constants T [s] of low-pass filters of first order, T dz/dt = p - z.
        tracker: (3,), time constants T = 1/w [s] of trackers of constant velocity: with d = sqrt(1/2),
            dy/dt = v + 2 d w (z - y), and dv/dt = w^2 (z - y). That is the damping d of a steady Kalman
            filter of constant velocity, whose noise is white acceleration.
        latency: (3,), ages T [s] at the time stamp, m(t) = y(t - T).
    """

    lag: tuple[float, float, float]
    tracker: tuple[float, float, float]
    latency: tuple[float, float, float]

    def __bool__(self) -> bool:
        return any(map(any, self))

    def undone(self, s: Smoothed) -> "BeforeFilters":
        """The motion before each of the filters."""
        return _undone(self, s)

    def undoing(self, w: np.ndarray) -> np.ndarray:
        """(3, n), factor by which undoing the filters multiplies what has a frequency w (n,) [rad/s]."""
        s = 1j * w
        lag, T = (np.array(each)[:, None] for each in (self.lag, self.tracker))
        return np.abs((1.0 + s * lag) * (1.0 + (s * T) ** 2 / (1.0 + np.sqrt(2.0) * T * s)))

    def first_response(self, h: np.ndarray) -> np.ndarray:
        """(3,), share of a new sample in the output of a filter computed at intervals h (3,) [s]."""
        with np.errstate(divide="ignore"):
            lag, tracker = (h / np.array(each) for each in (self.lag, self.tracker))
        return np.expm1(-lag) * np.expm1(-np.sqrt(2.0) * tracker)

    @property
    def squared_time(self) -> np.ndarray:
        """(3,), the factor of w^2 [s2] by which undoing the filters adds to a density, at the most."""
        return np.array(self.lag) ** 2 + 0.5 * np.array(self.tracker) ** 2

    def behind(self, poses: np.ndarray, start: "FilterStart", h: float) -> np.ndarray:
        """Poses (n, 3, p, w) behind the filters, exact for straight lines between.

        Args:
            poses: of windows, at their start and at equal intervals from there.
            start: of each filter.
            h: interval [s].
        """
        found = np.stack([*poses.transpose(1, 0, 2, 3)[:2], np.unwrap(poses[:, 2], axis=0)], axis=1)
        for k, (lag, T, late) in enumerate(zip(*self, strict=True)):
            if lag:
                found[:, k] = _lagging(found[:, k], _off(found[0, k], start.between[k], k), lag, h)
            if T:
                off = _off(found[0, k], start.timely[k], k)
                found[:, k] = _tracking(found[:, k], off, start.timely_rate[k], T, h)
            if late:
                found[:, k] = _late(found[:, k], _off(found[0, k], start.measured[k], k), late / h)
        return found


class BeforeFilters(NamedTuple):
    """The motion (n, 3) before each of the filters.

    Attributes:
        pose, rate: before all of them.
        between: pose behind the low-pass and before the tracker.
        timely, timely_rate: pose and its rate behind the tracker and before the latency.
    """

    pose: np.ndarray
    rate: np.ndarray
    between: np.ndarray
    timely: np.ndarray
    timely_rate: np.ndarray


class FilterStart(NamedTuple):
    """Where windows begin, (3, w) each; see :class:`BeforeFilters`. The last is the measured pose."""

    between: np.ndarray
    timely: np.ndarray
    timely_rate: np.ndarray
    measured: np.ndarray


@lru_cache  # a fit asks for the same runs several times
def _undone(f: Filters, s: Smoothed) -> BeforeFilters:
    """See :meth:`Filters.undone`: m(t + T) of a latency, y + T dy/dt of a low-pass, y + b of a tracker.

    The error b of the tracker follows 2 d w db/dt + w^2 b = d2y/dt2.
    """
    eta, eta_dot, eta_ddot = (np.array(part) for part in (s.eta, s.eta_dot, s.eta_ddot))
    for k, late in enumerate(f.latency):
        if late:
            motion = np.stack([eta[:, k], eta_dot[:, k], eta_ddot[:, k]])
            eta[:, k], eta_dot[:, k], eta_ddot[:, k] = _ahead(s.time, motion, late)
    timely, timely_rate = eta.copy(), eta_dot.copy()
    for k, T in enumerate(f.tracker):
        if T:
            tau = np.sqrt(2.0) * T
            error = T**2 * _low_passed(s.time, eta_ddot[:, k], tau)
            rate = (T**2 * eta_ddot[:, k] - error) / tau
            eta[:, k] += error
            eta_dot[:, k] += rate
            eta_ddot[:, k] += _derivative(rate, s.time)
    return BeforeFilters(eta + f.lag * eta_dot, eta_dot + f.lag * eta_ddot, eta, timely, timely_rate)


def _ahead(time: np.ndarray, motion: np.ndarray, T: float) -> np.ndarray:
    """A coordinate, its rate and second derivative (3, n) a time T [s] later.

    They are interpolated; behind the last row that is known, the second derivative stays as it is.
    """

    def after(first: np.ndarray, slope: Any, s: Any) -> np.ndarray:
        """The same a time s later, with a third derivative."""
        x, rate, bend = first
        moved = x + s * (rate + s * (0.5 * bend + s * slope / 6.0))
        return np.stack([moved, rate + s * (bend + 0.5 * s * slope), bend + slope * s])

    later = np.minimum(time + T, time[-1])
    end = np.clip(np.searchsorted(time, later, "right"), 1, time.size - 1)
    begin = end - 1
    slope = (motion[2, end] - motion[2, begin]) / (time[end] - time[begin])
    known = np.isfinite(motion[0, end]) & np.isfinite(motion[0, begin]) & (time + T <= time[-1])
    between = after(motion[:, begin], slope, later - time[begin])
    return np.where(known, between, after(motion, 0.0, T))


def _off(a: Any, b: Any, k: int) -> Any:
    return wrap(a - b) if k == 2 else a - b


def _lagging(p: np.ndarray, off: np.ndarray, lag: float, h: float) -> np.ndarray:
    """A coordinate (n, p, w) behind a low-pass filter whose output is off behind it at the start."""
    found, kept = np.array(p), np.exp(-h / lag)
    found[0] -= off
    for n, slope in enumerate(np.diff(p, axis=0) / h, start=1):
        off = lag * slope + kept * (off - lag * slope)
        found[n] -= off
    return found


def _tracking(p: np.ndarray, off: np.ndarray, rate: np.ndarray, T: float, h: float) -> np.ndarray:
    """The same behind a tracker, whose output has a rate at the start.

    Its error and that of its velocity are a free oscillation but where the slope of the input changes.
    """
    found, slopes = np.array(p), np.diff(p, axis=0) / h
    found[0] -= off
    a = 1.0 / (np.sqrt(2.0) * T)  # rad/s, frequency and decay of the oscillation
    decay, cos, sin = np.exp(-a * h), np.cos(a * h), np.sin(a * h)
    bb, bw, wb, ww = decay * (cos - sin), decay * sin / a, -2.0 * a * decay * sin, decay * (cos + sin)
    velocity = rate - 2.0 * a * off
    for n, slope in enumerate(slopes, start=1):
        slow = slope - velocity
        off, slow = bb * off + bw * slow, wb * off + ww * slow
        velocity = slope - slow
        found[n] -= off
    return found


def _late(y: np.ndarray, off: Any, steps: float) -> np.ndarray:
    """A coordinate (n, p, w) some steps later; before, on a line from where it was off at the start."""
    at = np.arange(len(y)) - steps
    before = np.clip(np.floor(at).astype(int), 0, max(len(y) - 2, 0))
    share = (at - before)[:, None, None]
    within = (1.0 - share) * y[before] + share * y[np.minimum(before + 1, len(y) - 1)]
    return np.where(at[:, None, None] < 0.0, y[0] + off * at[:, None, None] / steps, within)


def _derivative(x: np.ndarray, time: np.ndarray) -> np.ndarray:
    """Derivative (n,) of a signal over time, one-sided at the ends of each stretch that is known."""
    found = np.full(x.size, np.nan)
    for first, last in groups_of(np.isfinite(x)):
        part = slice(first, last)
        found[part] = np.gradient(x[part], time[part]) if last - first > 1 else 0.0
    return found


def _low_passed(time: np.ndarray, x: np.ndarray, T: float) -> np.ndarray:
    """A signal (n,) behind a low-pass filter, steady at the start and after each gap of NaN."""
    known = np.isfinite(x)
    before = np.append(False, known[:-1])
    kept = np.where(known & before, np.exp(-np.diff(time, prepend=time[:1]) / T), 0.0)
    mean = np.where(before, 0.5 * (np.append(x[:1], x[:-1]) + x), x)
    diagonals = np.stack([np.ones_like(x), np.append(-kept[1:], 0.0)])
    (solved,) = get_lapack_funcs(("tbtrs",), (diagonals,))
    right = np.where(known, (1.0 - kept) * mean, 0.0)
    found = solved(diagonals, right[:, None], uplo="L", diag="U")[0][:, 0]
    return np.where(known, found, np.nan)

"""Waves, found by a peak in the spectrum of the model error.

They come and go with no parameter of the ship, so nothing is fitted to them. They are looked for in what
the best model leaves over, as a ship that is held by a controller swings, too; the windows of the weak
form let hardly any of them through.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from fmus.vessel.vessel import State

from ...execution.parallel import for_each
from ...predictors import Model
from ...predictors.thrust import Response, inflow, thrust, unwrapped
from ...predictors.weak_form import acceleration, by_mass, in_wind
from ...runs import Run, Smoothed, SmoothMotion, body_acceleration, without_commands
from ...runs.cleaning import BRIEF, between
from ...runs.files.telegrams import groups_of
from ...runs.run_constants import NEGLIGIBLE
from ..map_regression import REPLICATES

# Seconds and Hz are those of CyberShip Enterprise 1, times the scale of the ship.
# The thresholds below were chosen on simulated runs with and without waves (benchmarks.hidden_effects).
BAND = (0.25, 1.2)  # Hz, in which waves are looked for: those of a basin for a ship of this size
PEAK = 4.0  # 1, times the spectrum around it, and its own flanks
FEW = 20.0  # 1, with one segment a peak must be so much higher, with n the n-th part of it
SEGMENT = 25.0  # s; six periods of the slowest wave
# 1, from which on a period is constant, see :func:`constancy`. Irregular waves of a damping of 0.1 have
# 0.82 and less in one stretch of 38 periods (100 draws), and the waves of the library 0.74.
CONSTANT = 0.85
DRAWINGS = 3  # 1, of noise, whose mean spectrum counts; chosen: of one, a line is low by chance


@dataclass(frozen=True)
class Waves:
    """What the spectrum shows.

    Attributes:
        peak: frequency [rad/s].
        force: standard deviation of the horizontal force around the peak [N].
        share: of the model error's power, on the axis where they stand out most.
        confidence: share of bootstrap replicates in which they stand out; at most (k + 1) / (n + 2),
            with k of n segments above the spectrum around (rule of succession): what was seen in few
            may be by chance, and waves last, where a burst does not; at most one half where commands
            were recorded less than twice in a period: forces in between look the same; where the
            period is constant, as that of a controller or an actuator that oscillates; and where the
            ship moves along one of its axes alone, as an antenna on a mast does, or a rudder moves it.
    """

    peak: float
    force: float
    share: float
    confidence: float


class Peak(NamedTuple):
    """A peak above the spectrum around it: index of frequency and axis, how many times higher."""

    row: int
    axis: int
    height: float


def find_waves(runs: Sequence[Smoothed], model: Model, rng: np.random.Generator) -> Waves | None:
    """The waves in some runs, if there are any.

    Args:
        runs: smoothed runs.
        model: the most likely one; what it leaves over is looked at.
        rng: for drawings of the noise, and for the bootstrap.
    """
    each = [(smoothed, rng.standard_normal((DRAWINGS, *smoothed.eta.shape))) for smoothed in runs]
    parts = for_each(lambda one: _signals(*one, model), each)
    left, noise = ([x for part in parts for x in part[k]] for k in (0, 1))
    if not left or not noise:
        return None
    time = model.ship.scale.time
    frequency, segments = segments_of(left, BRIEF * time)
    floor = segments_of(noise, BRIEF * time)[1].mean(axis=-1)
    power = segments.mean(axis=-1)
    white = np.mean([part[2] for part in parts], axis=0)
    follows = followed(frequency, floor, white, model.reference_mass)
    # What the smoother does not follow comes from the commands.
    band = inside(frequency * time)[:, None] & (follows >= 1.0 / PEAK)
    around = float(np.ptp(BAND)) / time
    level, found = peak(frequency, power, floor, band, around)
    count = segments.shape[-1]
    least = PEAK + FEW / count
    if found.height < least:
        return None
    at, errors = float(frequency[found.row]), [x[:, found.axis] for x in left]
    commands = [x for part in parts for x in part[3]]
    # Commands that change less than twice in a period answer no waves: what follows them is not waves.
    held = all(changes_per_second(s.track.run) < 2.0 * at for s in runs)
    if held and follows_commands(errors, commands, BRIEF * time, at, float(frequency[1])):
        return None
    drawn = (segments[..., d].mean(axis=-1) for d in rng.integers(0, count, (REPLICATES, count)))
    heights = np.array([peak(frequency, each, floor, band, around)[1].height for each in drawn])
    near = np.abs(frequency - at) < at / 2.0
    extra = np.maximum(power - level, 0.0)[near].sum(axis=0)
    lasting = segments_above(segments, found, level)
    rare = any(2.0 * at * command_interval(s.track.run) > 1.0 for s in runs)
    even = constancy(errors, BRIEF * time, at) > CONSTANT
    energy = extra / model.reference_mass.diagonal()
    alone = bool(energy.max() > (1.0 - NEGLIGIBLE) * energy.sum())
    doubtful = rare or even or alone
    return Waves(
        2.0 * np.pi * at,
        float(np.sqrt(extra[:2].sum() * frequency[1])),
        float(extra[found.axis] / power[:, found.axis].sum()),
        min(
            float(np.mean(heights >= least)),
            (lasting + 1) / (count + 2),
            0.5 if doubtful else 1.0,
        ),
    )


def command_interval(run: Run) -> float:
    """Interval at which the commands of a run were recorded [s].

    It is zero where most samples have commands of their own, or commands change at no regular times.
    """
    between = np.diff(run.time[1:][_changes(run)])
    sample = float(np.median(np.diff(run.time)))
    if not between.size or (usual := float(np.median(between))) < 1.5 * sample:
        return 0.0
    return usual if np.mean(np.abs(between - usual) < sample) > 0.5 else 0.0


def _signals(
    smoothed: Smoothed, drawn: np.ndarray, model: Model
) -> tuple[list[np.ndarray], list[np.ndarray], np.ndarray, list[np.ndarray]]:
    """Of a run stretches of its model error, of what drawn noise makes of that, noise (3,), commands."""
    time, step, track = smoothed.time, BRIEF * smoothed.scale.time, smoothed.track
    motion = without_commands(smoothed)
    error, noise = model_error(smoothed, motion, model), []
    for each in drawn:  # the same run with other noise of the same strength
        pose = np.where(smoothed.agrees, motion.eta + smoothed.noise * each, track.pose)
        other = model_error(smoothed, without_commands(smoothed, pose), model)
        noise += stretches(other - error, time, step)
    white = 2.0 * smoothed.noise**2 * track.periods
    given = np.where(np.isfinite(error[:, :1]), unwrapped(track.run.given, track.run, model), np.nan)
    return stretches(error, time, step), noise, white, stretches(given, time, step)


def segments_of(parts: Sequence[np.ndarray], step: float) -> tuple[np.ndarray, np.ndarray]:
    """Frequencies (m,) [Hz], and spectra (m, 3, segments) of signals (n, 3), a row each ``step`` [s]."""
    from scipy.signal import spectrogram  # only now: it takes a while to import

    length = round(SEGMENT / BRIEF)
    found = [spectrogram(x, 1.0 / step, nperseg=length, axis=0, detrend="linear")[2] for x in parts]
    return np.fft.rfftfreq(length, step), np.concatenate(found, axis=-1)


def followed(
    frequency: np.ndarray, noise: np.ndarray, white: np.ndarray, mass: np.ndarray
) -> np.ndarray:
    """Share (m, 3) of a motion that the smoother follows, as a spline of white jerk does.

    Args:
        frequency: (m,) [Hz].
        noise: (m, 3), spectrum of the force that noise makes.
        white: (3,), spectrum of the noise of the measurement [m2/Hz, m2/Hz, rad2/Hz].
        mass: (3, 3), mass matrix by which accelerations are forces.
    """
    from scipy.ndimage import median_filter

    level = np.array([white[:2].mean(), white[:2].mean(), white[2]])
    whole = np.diag(mass) ** 2 * level * (2.0 * np.pi * frequency[:, None]) ** 4
    share = median_filter(noise[1:] / whole[1:], size=(5, 1), mode="nearest")
    low = share < 0.25  # half of a motion is a quarter of its power
    corner = np.where(low.any(axis=0), frequency[1:][low.argmax(axis=0)], np.inf)
    return 1.0 / (1.0 + (frequency[:, None] / corner) ** 6)


def inside(frequency: np.ndarray) -> np.ndarray:
    """At which frequencies (m,) waves are looked for."""
    return (frequency >= BAND[0]) & (frequency <= BAND[1])


def peak(
    frequency: np.ndarray, power: np.ndarray, floor: np.ndarray, band: np.ndarray, around: float
) -> tuple[np.ndarray, Peak]:
    """The spectrum around each frequency (m, 3), and the highest peak above it in a band.

    Args:
        frequency, power: (m,) [Hz] and (m, 3), the spectrum.
        floor: (m, 3), what noise alone makes; the smoother takes away what is quick.
        band, around: (m, 3), where a peak counts, and width of the spectrum around [Hz].
    """
    from scipy.ndimage import median_filter
    from scipy.signal import find_peaks

    width = 2 * int(around / frequency[1] / 2.0) + 1
    floor = np.maximum(floor, 1e-3 * floor.max(axis=0))
    level = floor * median_filter(power / floor, size=(width, 1), mode="nearest")
    # Where the error of a slow motion falls into the band its flank is above the median, and no peak.
    above = np.zeros_like(band)
    for axis, spectrum in enumerate(np.log(np.maximum(power, np.finfo(float).tiny)).T):
        above[find_peaks(spectrum, prominence=np.log(PEAK))[0], axis] = True
    height = np.where(band & above, power / np.maximum(level, np.finfo(float).tiny), 0.0)
    row, axis = np.unravel_index(int(np.argmax(height)), height.shape)
    return level, Peak(int(row), int(axis), float(height[row, axis]))


def constancy(signals: Sequence[np.ndarray], step: float, near: float) -> float:
    """How far signals oscillate with a constant period each, whatever their amplitudes and signs.

    z is the analytic signal within a quarter of a frequency. Where its period is constant, all of z^2
    has twice one frequency w: 1 = |sum z^2 exp(-2 i w t)| / sum |z|^2 at the best w, and less where the
    period wanders.

    Args:
        signals: (n,) each.
        step: between samples [s].
        near: the frequency [Hz].
    """
    at_best = total = 0.0
    for x in signals:
        z = _analytic(x, step, near, near / 4.0)
        fine, twice = np.abs(np.fft.fft(z * z, 8 * x.size)), np.fft.fftfreq(8 * x.size, step)
        at_best += fine[np.abs(twice - 2.0 * near) < near / 2.0].max(initial=0.0)
        total += float((np.abs(z) ** 2).sum())
    return at_best / total if total > 0.0 else 0.0


def changes_per_second(run: Run) -> float:
    """How often commands of a run change [1/s]."""
    return float(_changes(run).sum() / (run.time[-1] - run.time[0]))


def _changes(run: Run) -> np.ndarray:
    """(n - 1,), whether any command differs from that of the row before."""
    return (np.diff(run.given, axis=0) != 0.0).any(axis=1)


def follows_commands(
    signals: Sequence[np.ndarray], commands: Sequence[np.ndarray], step: float, at: float, row: float
) -> bool:
    """Whether most of an oscillation follows commands, with one gain and phase for each of them.

    What a model makes wrong of commands does so, as at a harmonic of a zig-zag.

    Args:
        signals, commands: (n,) and (n, k) each.
        step: between samples [s].
        at, row: frequency of the oscillation, and the distance to the next one [Hz].
    """
    y, given = (
        np.concatenate([_analytic(x, step, at, 2.0 * row) for x in each]) for each in (signals, commands)
    )
    left = y - given @ np.linalg.lstsq(given, y, rcond=None)[0]
    return 2.0 * float(np.sum(np.abs(left) ** 2)) < float(np.sum(np.abs(y) ** 2))


def _analytic(x: np.ndarray, step: float, at: float, width: float) -> np.ndarray:
    """Analytic signals of signals (n, ...) within a width of a frequency [Hz]; step between rows [s]."""
    from scipy.signal import detrend

    size = len(x)
    spectrum = np.fft.fft(detrend(x, axis=0), 2 * size, axis=0)
    spectrum[np.abs(np.fft.fftfreq(2 * size, step) - at) >= width] = 0.0
    return np.fft.ifft(spectrum, axis=0)[:size]


def segments_above(segments: np.ndarray, found: Peak, level: np.ndarray) -> int:
    """In how many of the spectra (m, 3, segments) a peak is above the spectrum around (m, 3)."""
    at_peak = segments[max(found.row - 1, 0) : found.row + 2, found.axis].max(axis=0)
    return int(np.count_nonzero(at_peak > level[found.row, found.axis]))


def model_error(smoothed: Smoothed, motion: SmoothMotion, model: Model) -> np.ndarray:
    """omega (n, 3) [N, N, N m] by the acceleration of a run's motion, NaN where there is none."""
    run = smoothed.track.run
    eta, _, eta_ddot, nu = motion
    nu_dot = body_acceleration(eta[:, 2], nu, eta_ddot)
    between = Response(run, model).between_samples
    s = State._make([*eta.T, *nu.T, run.time])
    met = inflow(s, in_wind(model, smoothed, s))
    driven = by_mass(model, thrust(run, model, between, np.nan_to_num(np.column_stack(met))))
    free = acceleration(model, smoothed, eta, nu)
    return (nu_dot - free - driven) @ model.reference_mass.T


def stretches(error: np.ndarray, time: np.ndarray, step: float) -> list[np.ndarray]:
    """Parts (m, 3) without a gap and long enough for a spectrum, a row each ``step`` [s]."""
    known = np.all(np.isfinite(error), axis=1, keepdims=False)
    found = []
    for first, end in groups_of(known):
        even = np.arange(float(time[first]), float(time[end - 1]), step)
        if even.size <= SEGMENT / BRIEF:  # one is lost by the difference
            continue
        # Means over each interval: what is quicker must not pass for something slow.
        sums = np.cumsum(error[first:end] * np.gradient(time[first:end])[:, None], axis=0)
        at = between(even, time[first:end], sums)
        found.append(np.diff(at, axis=0) / step)
    return found

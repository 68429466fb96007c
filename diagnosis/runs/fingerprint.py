"""What a run is known by again: the hash of its file, and the course of its velocities.

The course is that of the body's velocities, so that neither the place nor the direction of north
matters. It is compared by correlation, so that neither its size nor its sign does, piece by piece and at
any time, so that a run that is cut, shifted or sampled at other times is known again.
"""

from base64 import b64decode, b64encode
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from hashlib import sha256
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from cosim import InputError

from .run_constants import FAR_OFF, IN_A_ROW, PARTS, SAME

if TYPE_CHECKING:  # at run time it takes a while to import
    from .smoothing.smoother import Smoothed

POINTS = 512  # 1, of a course; chosen: 2 kB of text, and some points in each manoeuvre of a trial


@dataclass(frozen=True, eq=False)
class Fingerprint:
    """A run, as a model that was learned from it remembers it.

    Attributes:
        name: of the run.
        sha256: of its file, or of its samples where there is none.
        period: between two points of the course [s].
        course: (n, 3), velocities u, v, r, of each its largest size the unit.
        certain: (3,), standard deviation of each in that unit.
    """

    name: str
    sha256: str
    period: float
    course: np.ndarray
    certain: np.ndarray

    @classmethod
    def of(cls, smoothed: "Smoothed") -> "Fingerprint":
        """That of a run."""
        run, known = smoothed.track.run, np.isfinite(smoothed.nu[:, 0])
        time, nu = run.time[known], smoothed.nu[known]
        period = max((time[-1] - time[0]) / POINTS, float(np.median(np.diff(time))))
        at = np.arange(time[0], time[-1], period)
        course = np.column_stack([np.interp(at, time, x) for x in nu.T])
        unit = np.maximum(np.abs(course).max(axis=0), np.finfo(float).tiny)
        certain = np.nanmedian(smoothed.nu_std, axis=0) / unit
        own = next(iter(run.hashes.values()), "") or samples_sha256(smoothed)
        return cls(run.name, own, period, course / unit, certain)

    @classmethod
    def read(cls, stated: Mapping[str, Any]) -> "Fingerprint":
        """That of :meth:`content`; a ValueError, KeyError or TypeError where it is none."""
        course = (
            np.frombuffer(b64decode(stated["course"], validate=True), np.int8).reshape(-1, 3) / 127.0
        )
        certain = np.array(stated["certain"], float).reshape(3)
        return cls(str(stated["name"]), str(stated["sha256"]), float(stated["period"]), course, certain)

    def content(self) -> dict[str, Any]:
        """What JSON can hold of it."""
        course = b64encode(np.rint(127.0 * self.course).astype(np.int8).tobytes()).decode()
        certain = [float(f"{x:.3g}") for x in self.certain]
        kept = {"name": self.name, "sha256": self.sha256, "period": self.period}
        return kept | {"course": course, "certain": certain}

    @cached_property
    def seconds(self) -> float:
        """Length of the run [s]."""
        return self.period * (len(self.course) - 1)

    def alike(self, other: "Fingerprint") -> bool:
        """Whether two runs are the same, or nearly: most of the shorter one is found in the longer."""
        if self.sha256 == other.sha256:
            return True
        short, long = sorted((self, other), key=lambda f: f.seconds)
        return float(np.median([*_pieces(short, long)] or [0.0])) > SAME


def fingerprints(stated: Iterable[Mapping[str, Any]], where: Path) -> tuple[Fingerprint, ...]:
    """Those that a file tells.

    Raises:
        InputError: one is none.
    """
    try:
        return tuple(map(Fingerprint.read, stated))
    except (ValueError, KeyError, TypeError):
        raise InputError(f"'{where}': its list of training runs is damaged") from None


def _pieces(short: Fingerprint, long: Fingerprint) -> Iterator[float]:
    """Of each piece of a course, as far as it moves, its best correlation with a part of a longer."""
    period = long.period
    for begin in short.seconds / PARTS * np.arange(PARTS):
        found = []
        for shift in np.linspace(0.0, period, 8, endpoint=False):
            at = np.arange(begin + shift, begin + short.seconds / PARTS, period)
            grid = short.period * np.arange(len(short.course))
            piece = np.column_stack([np.interp(at, grid, x) for x in short.course.T])
            if IN_A_ROW <= len(piece) <= len(long.course):
                found.append(_correlation(piece, long.course, short.certain))
        if found and not np.isnan(best := float(np.max(found))):
            yield best


def _correlation(piece: np.ndarray, course: np.ndarray, certain: np.ndarray) -> float:
    """The largest correlation of a piece (m, 3) with parts of a course (n, 3); NaN where it is still."""
    from scipy.signal import fftconvolve  # only now: it takes a while to import

    m = len(piece)
    off = piece - piece.mean(axis=0)
    power = np.mean(off**2, axis=0)
    moving = power > (FAR_OFF * certain) ** 2
    if not moving.any():
        return np.nan
    total = np.zeros(len(course) - m + 1)
    for x, y in zip(off.T[moving], course.T[moving], strict=True):
        sums = (np.convolve(z, np.ones(m), "valid") for z in (y, y * y))
        mean, square = (s / m for s in sums)
        spread = np.sqrt(np.maximum(square - mean**2, 0.0) * np.mean(x**2))
        product = fftconvolve(y, x[::-1], "valid") / m
        total += np.abs(np.divide(product, spread, out=np.zeros_like(spread), where=spread > 1e-6))
    return float(total.max() / moving.sum())


def samples_sha256(smoothed: "Smoothed") -> str:
    """Hash of the samples of a run: time, pose and commands, as they were read."""
    run = smoothed.track.run
    columns = np.column_stack([run.time, run.pose, run.tau_cmd, *run.commanded.values()])
    return sha256(np.ascontiguousarray(columns, "<f8").tobytes()).hexdigest()

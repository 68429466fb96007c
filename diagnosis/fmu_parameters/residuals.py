"""Measured minus predicted outputs in windows, in units of their standard deviation.

What a window begins with is known by some samples only. Its uncertainty is integrated out: by a start
value of variance p the residuals of a window have the covariance I + S p S^T, S their slopes by the
start value, and are whitened by the inverse root of that. Where a prediction is not linear in its start,
the slopes are those about the most likely start (Laplace's method).
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from types import MappingProxyType
from typing import Any

import numpy as np
from scipy.optimize import least_squares

from cosim import InputError
from fmus.ops import wrap

from ..predictors.black_box import laid
from ..predictors.fmu.fmu_playback import PlaybackRequest, PlayedBack, Processes
from .additional_force import AdditionalForce
from .measured_system import Window
from .parameter_file import CalibratedParameter

DIFFERENCE = 0.02  # 1, at most, in standard deviations of a prior or a start value; chosen
LARGEST = np.sqrt(np.sqrt(np.finfo(float).max))  # of a residual: sums of squares of more may overflow
LINEAR = 0.3  # 1, rms by which a prediction may differ from its slopes, in units of the noise; chosen


@dataclass(frozen=True)
class Setting:
    """An FMU with other values and additional forces.

    Attributes:
        z: of each parameter, in prior standard deviations from its prior mean.
        forces: what acts in addition.
    """

    z: tuple[float, ...]
    forces: tuple[AdditionalForce, ...] = ()

    def with_coefficients(self, values: Iterable[float]) -> "Setting":
        """The same with other coefficients of its forces."""
        pairs = zip(self.forces, values, strict=True)
        return Setting(self.z, tuple(replace(f, coefficient=c) for f, c in pairs))


@dataclass(frozen=True, eq=False)
class Whitening:
    """Of one window: the directions in which its start moves the residuals, and what is left of them.

    Attributes:
        along, kept: singular vectors (n, k), and the factor (k,) of the residuals along each.
        begin: start value -> value about which the slopes are.
        lead: (n,), change of the residuals by the slopes, from the measured start to ``begin``.
    """

    along: np.ndarray
    kept: np.ndarray
    begin: Mapping[str, float]
    lead: np.ndarray

    def __call__(self, r: np.ndarray) -> np.ndarray:
        """Whitened residuals (n,), or slopes (n, q)."""
        return r + self.along @ (
            (self.kept - 1.0)[:, None] * (self.along.T @ r.reshape(len(r), -1))
        ).reshape((-1, *r.shape[1:]))


class WindowResiduals:
    """The residuals (size,) of an FMU in the windows of some runs, those without a sample included.

    Args:
        processes: that run the FMU.
        windows: of the runs.
        noise: (m,), of each output.
        parameters: that are calibrated.
        lines: (2, m), gain and offset that make of an output what is measured; None: it is that.
        angles: numbers of the outputs that are angles [rad].

    Attributes:
        failed: values with which the FMU failed in a fit, and why.
    """

    def __init__(
        self,
        processes: Processes,
        windows: Sequence[Window],
        noise: np.ndarray,
        parameters: Sequence[CalibratedParameter],
        lines: np.ndarray | None = None,
        angles: Sequence[int] = (),
    ) -> None:
        self.processes, self.windows = processes, windows
        self.noise, self.parameters, self.angles = noise, parameters, [*angles]
        m = noise.size
        self._gain, self._offset = np.stack([np.ones(m), np.zeros(m)]) if lines is None else lines
        self._known: dict[tuple[Setting, bool], np.ndarray] = {}
        self.failed: list[tuple[dict[str, float], str]] = []
        self._steps: dict[str, float] = {}
        self._whitening: list[Whitening] = []
        sizes = [w.measured.size for w in windows]
        ends = np.cumsum([0, *sizes])
        self.rows = [slice(a, b) for a, b in pairwise(ends.tolist())]

    @property
    def start(self) -> Setting:
        """The prior means, without additional forces."""
        return Setting((0.0,) * len(self.parameters))

    def choose(self, parameters: Sequence[CalibratedParameter]) -> None:
        """Calibrate other parameters."""
        self.parameters = parameters
        self._known.clear()

    @property
    def failures(self) -> str:
        """Where the FMU failed in a fit, in a sentence; empty: nowhere."""
        if not self.failed:
            return ""
        values, why = self.failed[0]
        at = "".join(f", {name} = {x:.4g}" for name, x in values.items())
        return (
            f"The FMU fails with {len(self.failed)} of the values that the fit tried, which it avoids; "
            f"the first{at}: {why}"
        )

    @property
    def samples(self) -> int:
        """Number of measured values."""
        return int(sum(np.isfinite(w.measured).sum() for w in self.windows))

    def values(self, setting: Setting) -> dict[str, float]:
        """Parameter -> value."""
        return {p.name: p.at(z) for p, z in zip(self.parameters, setting.z, strict=True)}

    def predict(
        self, settings: Sequence[Setting], windows: Sequence[int] | None = None
    ) -> list[list[PlayedBack]]:
        """Of each setting the prediction in each window."""
        which = self.windows if windows is None else [self.windows[k] for k in windows]
        found = self.processes.run([self._prediction(w, s) for s in settings for w in which])
        return [found[j : j + len(which)] for j in range(0, len(found), len(which))]

    def _prediction(
        self, w: Window, setting: Setting, begin: Mapping[str, float] = MappingProxyType({})
    ) -> PlaybackRequest:
        """That of a window with a setting and other start values."""
        start = {**w.course.start, **self.values(setting), **begin}
        of = self.processes
        terms = [t for f in setting.forces for t in f.terms(of.inputs, of.outputs)]
        return w.course._replace(start=start, terms=terms)

    def raw(self, settings: Sequence[Setting]) -> list[np.ndarray]:
        """Of each setting the residuals (size,) in units of the noise; NaN where the FMU fails."""
        return self._residuals(settings, [{}] * len(self.windows))

    def _residuals(
        self, settings: Sequence[Setting], begins: Sequence[Mapping[str, float]]
    ) -> list[np.ndarray]:
        """The same where the windows begin with other start values."""
        moved = any(begins)
        new = [s for s in dict.fromkeys(settings) if (s, moved) not in self._known]
        asked = [
            self._prediction(w, s, begin)
            for s in new
            for w, begin in zip(self.windows, begins, strict=True)
        ]
        predicted = iter(self.processes.run(asked))
        for s in new:
            each = [next(predicted) for _ in self.windows]
            why = next((p.fault for p in each if p.fault), "")
            if why:
                self.failed.append((self.values(s), why))
            off = [self._off(w, p) for w, p in zip(self.windows, each, strict=True)]
            self._known[s, moved] = np.concatenate(off)
        # A fit asks for the same again at once, with its slopes.
        self._known = {(s, moved): self._known[s, moved] for s in settings}
        return [self._known[s, moved] for s in settings]

    def _off(self, w: Window, p: PlayedBack) -> np.ndarray:
        at = w.course.h * np.arange(len(p.outputs))
        with np.errstate(invalid="ignore", over="ignore"):
            outputs = self._gain * p.outputs[:, : self.noise.size] + self._offset
            for k in self.angles:
                outputs[:, k] = np.unwrap(outputs[:, k])
            predicted = np.column_stack([np.interp(w.time, at, y) for y in outputs.T])
            if w.onto is not None:
                predicted = laid(predicted[..., None], np.zeros(1), w.onto[:, None])[..., 0]
            off = w.measured - predicted
            off[:, self.angles] = wrap(off[:, self.angles])
            off /= self.noise
            off[~(np.abs(off) < LARGEST)] = np.nan
        off[~np.isfinite(w.measured)] = 0.0
        return off.ravel()

    def parts(self, r: np.ndarray) -> Iterator[tuple[Window, np.ndarray]]:
        """Each window with its part of residuals (size,)."""
        return ((w, r[rows]) for w, rows in zip(self.windows, self.rows, strict=True))

    def whitened(self, settings: Sequence[Setting]) -> list[np.ndarray]:
        """Of each setting the whitened residuals (size,)."""
        found = self._residuals(settings, [white.begin for white in self._whitening])
        each = [*zip(self._whitening, self.rows, strict=True)]
        return [np.concatenate([white(r[rows] - white.lead) for white, rows in each]) for r in found]

    def whiten_about(self, setting: Setting) -> None:
        """Take the slopes by the start values about a setting.

        Raises:
            InputError: the FMU fails there.
        """
        self._known.clear()
        self._whitening = [self._whitening_of(w, setting) for w in self.windows]

    def _whitening_of(self, w: Window, setting: Setting) -> Whitening:
        """Of one window, about the most likely start where its prediction is not linear in that."""
        names, std = [*w.start_std], np.array([*w.start_std.values()])
        middle, z = np.array([w.course.start[n] for n in names]), np.zeros(len(names))

        def begin(z: np.ndarray) -> dict[str, float]:
            return dict(zip(names, (middle + z * std).tolist(), strict=True)) if z.any() else {}

        def at(starts: Sequence[np.ndarray]) -> list[PlayedBack]:
            return self.processes.run([self._prediction(w, setting, begin(x)) for x in starts])

        def off(z: np.ndarray) -> np.ndarray:
            (there,) = at([z])
            return np.concatenate([np.nan_to_num(self._off(w, there), nan=LARGEST), z])

        def slopes(z: np.ndarray) -> np.ndarray:
            base, *moved = (self._off(w, p) for p in at([z, *(z + DIFFERENCE * np.eye(z.size))]))
            S = np.column_stack([(r - base) / DIFFERENCE for r in moved])
            return np.where(np.isfinite(S).all(axis=0), S, 0.0)

        (here,) = at([z])
        if here.fault:
            raise InputError(f"'{self.processes.name}' fails on run '{w.run}': {here.fault}")
        base = self._off(w, here)
        if not names:
            return Whitening(np.zeros((base.size, 0)), np.zeros(0), {}, np.zeros(base.size))
        S = slopes(z)
        best = -np.linalg.solve(np.eye(z.size) + S.T @ S, S.T @ base)
        bend = off(best)[: base.size] - base - S @ best
        if np.sqrt(np.mean(bend**2)) > LINEAR:
            jacobian: Any = lambda z: np.concatenate([slopes(z), np.eye(z.size)])  # noqa: E731
            z = least_squares(off, z, jacobian).x
            S = slopes(z)
        U, size, _ = np.linalg.svd(S, full_matrices=False)
        return Whitening(U, 1.0 / np.sqrt(1.0 + size**2), begin(z), S @ z)

    def slopes(self, setting: Setting, sizes: Sequence[float]) -> tuple[np.ndarray, list[str]]:
        """Slopes (size, p + e) of the whitened residuals by each z and each coefficient.

        By central differences, where one side fails by the other; zero where both do.

        Args:
            setting: about which.
            sizes: of each additional force the unit of its coefficient.

        Returns:
            The slopes, and why those that are zero are not known.
        """
        found = self._differences(setting, sizes)
        change = np.sqrt(np.mean(found[0] ** 2, axis=0))
        names = [*(p.name for p in self.parameters), *(f.id for f in setting.forces)]
        last = [self._steps.get(n, DIFFERENCE) for n in names]
        # A step that changes the residuals by more than the noise shows the curvature of a prediction in
        # its slope; a shorter one shows the rounding of solvers.
        steps = np.minimum(DIFFERENCE, 1.0 / np.maximum(change, 1.0 / DIFFERENCE))
        self._steps |= zip(names, steps.tolist(), strict=True)
        again = np.any(np.array(last) > 2.0 * steps)
        return self._differences(setting, sizes) if again else found

    def _differences(self, setting: Setting, sizes: Sequence[float]) -> tuple[np.ndarray, list[str]]:
        """The same with the steps that the last slopes ask for."""
        each = [*self._moved(setting, sizes)]
        settings = [s for _, low, high, _, _ in each for s in (low, high)]
        found = self.whitened([setting, *settings])
        base, others = found[0], found[1:]
        columns, faults = [], []
        for (name, *_, down, up), low, high in zip(each, others[::2], others[1::2], strict=True):
            sides = [(low, down), (high, up)]
            known = [(r, h) for r, h in sides if h and np.isfinite(r).all()]
            if len(known) == 2:
                columns.append((known[1][0] - known[0][0]) / (known[0][1] + known[1][1]))
            elif known:
                r, h = known[0]
                columns.append((r - base) / (h if r is high else -h))
            else:
                columns.append(np.zeros_like(base))
                faults.append(f"{name}: the FMU fails on both sides of its value")
        return np.column_stack([*columns, np.zeros((base.size, 0))]), faults

    def _moved(
        self, setting: Setting, sizes: Sequence[float]
    ) -> Iterator[tuple[str, Setting, Setting, float, float]]:
        """Name, two settings about one, and how far they are apart from it, for each value."""
        for k, p in enumerate(self.parameters):
            low, high = p.bounds
            z = setting.z[k]
            step = self._steps.get(p.name, DIFFERENCE)
            down, up = min(step, max(z - low, 0.0)), min(step, max(high - z, 0.0))
            yield p.name, self.at(setting, k, z - down), self.at(setting, k, z + up), down, up
        present = np.array([f.coefficient for f in setting.forces])
        for f, size, axis in zip(setting.forces, sizes, np.eye(present.size), strict=True):
            step = self._steps.get(f.id, DIFFERENCE)
            ends = (present - step * size * axis, present + step * size * axis)
            low, high = (setting.with_coefficients(c.tolist()) for c in ends)
            yield f.id, low, high, step, step

    @staticmethod
    def at(setting: Setting, k: int, z: float) -> Setting:
        """A setting with another value of a parameter."""
        return Setting((*setting.z[:k], z, *setting.z[k + 1 :]), setting.forces)


def rms_of(
    r: WindowResiduals, raw: np.ndarray, outputs: Sequence[str]
) -> Mapping[str, Mapping[str, float]]:
    """Run -> output -> root mean square of raw residuals (size,), in the unit of the output."""
    found: dict[str, dict[str, float]] = {}
    for run in dict.fromkeys(w.run for w in r.windows):
        mine = [(w, x) for w, x in r.parts(raw) if w.run == run]
        squares = np.concatenate([x.reshape(w.measured.shape) for w, x in mine]) ** 2
        known = np.concatenate([np.isfinite(w.measured) for w, _ in mine])
        mean = np.where(known, squares, 0.0).sum(axis=0) / np.maximum(known.sum(axis=0), 1)
        found[run] = dict(zip(outputs, (np.sqrt(mean) * r.noise).tolist(), strict=True))
    return found

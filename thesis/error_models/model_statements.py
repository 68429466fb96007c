"""Statements of 7.2.4 and 7.4 on models of the model error, each with its verdict."""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from studies.study_report import Verdict

from .. import analysis
from ..analysis import NAMES, Samples
from ..basin_trials.trials import LOST
from ..tracking.outcome import AXES, Log, missing, rms

MAIN = 0.5  # 1, R² from which a model explains the main part of the model error; chosen
SIMILAR = 0.25  # 1, difference of two runs, relative, up to which they are similar; chosen
REMOVES = 0.5  # 1, share of an error that may remain where a controller "minimises" it; chosen
KEEPS = 0.9  # 1, share of an error from which a controller does not remove it; chosen
NOTHING = 1e-3  # N, model error below which there is none to adapt to; chosen: far below the noise's
LINEAR = tuple(NAMES.index(f"{axis}_{speed}") for axis, speed in zip(AXES, "urr", strict=True))
HYDRODYNAMIC = [k for k, name in enumerate(NAMES) if not name.startswith("delta")]


class LoopResult(NamedTuple):
    """Distance to the target, RMS [m], mean z1_x over the second half [m], and every tenth row."""

    position: float
    lag: float
    log: Log

    @property
    def lost(self) -> bool:
        """Whether the run broke off or the ship was far from its target."""
        return not self.position < LOST

    def aside(self) -> float:
        """z1_y over the second half, RMS [m]."""
        return rms(self.log["controller.z1_y"][self.late])

    @property
    def late(self) -> np.ndarray:
        """Rows of the second half."""
        time = self.log["time"]
        return time >= 0.5 * time[-1]

    def omega(self) -> np.ndarray:
        """Model error of the second half (n, 3) [N, N, N m]."""
        return np.column_stack([missing(self.log, a) for a in AXES])[self.late]

    def known(self, axis: str) -> float:
        """Share of the mean square of the model error, second half, that ω̂ explains [1]."""
        true, estimate = missing(self.log, axis), self.log[f"controller.omega_hat_{axis}"]
        return 1.0 - (rms((true - estimate)[self.late]) / max(rms(true[self.late]), 1e-9)) ** 2


def by_axis(values: np.ndarray) -> str:
    return ", ".join(f"{a} {x:.3f}" for a, x in zip(AXES, values, strict=True))


def listed(values: Mapping[str, np.ndarray]) -> str:
    return "; ".join(f"{name}: {by_axis(x)}" for name, x in values.items())


def explaining(thesis: str, r2: Mapping[str, np.ndarray]) -> Verdict:
    """Whether models explain the main part of the model error on all axes: name -> R² (3,)."""
    here = {name: bool((x >= MAIN).all()) for name, x in r2.items()}
    return Verdict(thesis, here, f"R² of ω, main part from {MAIN:g}: {listed(r2)}")


def linear_share(s: Samples, phi: np.ndarray) -> np.ndarray:
    """Share (3,) of the linear coefficients in the RMS of the damping force by a model."""
    forces = analysis.regressors(s)[:, :, HYDRODYNAMIC] * phi[HYDRODYNAMIC]
    linear = np.array([rms(forces[:, k, j]) for k, j in enumerate(LINEAR)])
    rest = forces.sum(axis=2) - np.column_stack([forces[:, k, j] for k, j in enumerate(LINEAR)])
    return linear / (linear + np.sqrt(np.square(rest).mean(axis=0)))


def linear(shares: Mapping[str, np.ndarray]) -> Verdict:
    """Whether the linear coefficients make more of the force than all others: name -> share (3,)."""
    return Verdict(
        "Linear coefficients dominate the identified models (Table 7.1)",
        {name: bool((x > MAIN).all()) for name, x in shares.items()},
        f"more than {MAIN:g}: share of X_u, Y_r, N_r in the RMS of the damping force: {listed(shares)}",
    )


def systematic(eight: np.ndarray, ellipse: np.ndarray) -> Verdict:
    """Whether regressions explain less of the model error of the eight, by Q² (3,)."""
    return Verdict(
        "The model error of the eight is not as systematic as that of the ellipse (6.4.3)",
        dict(zip(AXES, (eight < ellipse).tolist(), strict=True)),
        f"Q² of PLS2: eight {by_axis(eight)}; ellipse {by_axis(ellipse)}",
    )


def difference(a: LoopResult, b: LoopResult) -> np.ndarray:
    """RMS of the difference of the model error of two runs over that of the first (3,)."""
    x, y = a.omega(), b.omega()
    n = min(len(x), len(y))
    return np.array([rms((x - y)[:n, k]) / max(rms(x[:n, k]), 1e-9) for k in range(3)])


def alike(measured: LoopResult, model: LoopResult) -> Verdict:
    """Whether a model in the ship gives the position, z1 and model error of the run it was made of."""
    pairs = ((measured.position, model.position), (measured.lag, model.lag))
    off = [abs(b / a - 1.0) for a, b in pairs]
    omega = difference(measured, model)
    here = dict(zip(("position", "z1_x"), (bool(x < SIMILAR) for x in off), strict=True))
    here |= {f"ω {a}": bool(x < SIMILAR) for a, x in zip(AXES, omega, strict=True)}
    return Verdict(
        "PLS3 in the ship gives trajectory, z1 and ω of the run it was made of (7.4, Figs. 7.11, 7.12)",
        here,
        f"similar: within {100.0 * SIMILAR:g} %. Position {measured.position:.3f} and "
        f"{model.position:.3f} m, z1_x {measured.lag:.3f} and {model.lag:.3f} m; RMS of the difference "
        f"of ω over that of ω: {by_axis(omega)}",
    )


def controlled(plain: Mapping[str, LoopResult], learning: Mapping[str, LoopResult]) -> list[Verdict]:
    """What concurrent learning does to both parts of z1, model by model, against backstepping."""
    across = {n: learning[n].aside() / max(plain[n].aside(), 1e-9) for n in learning}
    along = {n: abs(learning[n].lag / plain[n].lag) for n in learning}
    known = {n: r.known("Y") for n, r in learning.items() if rms(r.omega()[:, 1]) > NOTHING}

    def numbers(values: Mapping[str, float]) -> str:
        return ", ".join(f"{n} {x:.2f}" for n, x in values.items())

    return [
        Verdict(
            "CLE minimises the error across the path (7.4, Fig. 7.14a)",
            {n: x < REMOVES for n, x in across.items()},
            f"z1_y, RMS of the second half over that of RBS, below {REMOVES:g}: {numbers(across)}",
        ),
        Verdict(
            "CLE cannot remove the deviation in surge (7.4, Fig. 7.14a)",
            {n: x > KEEPS for n, x in along.items()},
            f"mean z1_x over that of RBS, above {KEEPS:g}: {numbers(along)}",
        ),
        Verdict(
            "The controllers adapt to the model error in sway (7.4, Figs. 7.14, 7.15)",
            {n: x >= MAIN for n, x in known.items()},
            f"share of the mean square of ω in sway that ω̂ explains, from {MAIN:g}: {numbers(known)}",
        ),
    ]


def reacting(reference: LoopResult, others: Mapping[str, LoopResult], apart: str) -> Verdict:
    """Whether the model errors are similar but for one model's, whose yaw differs most."""
    off = {n: difference(reference, r) for n, r in others.items()}
    least = min(float(x[2]) for n, x in off.items() if n != apart)
    return Verdict(
        f"ω of the models reacts similarly, but {apart} differs, above all in yaw (7.4, Fig. 7.15)",
        bool(off[apart][2] > max(least, SIMILAR)),
        f"RMS of the difference to ω with SYSID4 over that of it, in yaw more than the others and "
        f"{SIMILAR:g}: {listed(off)}",
    )

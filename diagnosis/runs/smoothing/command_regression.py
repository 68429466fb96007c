"""Regression of a pose on the motions that commands would give, beside a smoothing spline.

With f, the spline, integrated out, the largest likelihood is that of generalised least squares. A are
the motions for unit gains, P is the hat matrix of the spline, and r(a) the residuals
[sqrt(W) (a - P a), sqrt(s) roughness of P a]:

    g = argmin |r(z) - r(A) g|^2,    taken = r(z)^T r(A) g / sigma^2.
"""

import numpy as np
from scipy.linalg import LinAlgError

from fmus.ship import ship

from ..cleaning import WIDTH, between
from ..run_constants import DIGITS, NEGLIGIBLE
from .command_motion import Commands, Gains, Lateness
from .penalised import Fit, Problem
from .spline import middles


class Regression:
    """Generalised least squares of a run's pose on its commands, beside a spline.

    Args:
        problem: the pose.
        fit: a smoothing spline of it.
        commands: commands and headings.
        time: (n,), of the pose, since the run's start [s].
    """

    def __init__(self, problem: Problem, fit: Fit, commands: Commands, time: np.ndarray) -> None:
        self.problem, self.fit, self.commands, self.time = problem, fit, commands, time
        self.time_scale = commands.track.scale.time
        pose = [self._residual(c, problem.z[:, [c]]) for c in range(3)]
        self.pose = np.vstack(pose[:2]), pose[2]

    def gains(self, late: Lateness, described: np.ndarray | None = None, bent: bool = False) -> Gains:
        """What the commands accelerate.

        Args:
            late: how late they act.
            described: G (3, 3), as the ship's description has it, by which H is fitted; None: G is, and
                H is zero.
            bent: whether the bend of the way counts.
        """
        force, pose = self.commands.tau_late(late), self.pose
        if described is not None:
            known = self.motion(force @ described.T)
            pose = pose[0] - known[0], pose[1] - known[1]
            force = self.commands.slow(late)
        plane, yaw = self.motions(force)
        if bent:
            plane = np.hstack([plane, self._in_plane(self.commands.bend)])
        flat, turn = unlike(plane, pose[0]), unlike(yaw, pose[1])
        fitted, share = np.vstack([flat[:6].reshape(2, 3), turn]), float(flat[6:].sum())
        return Gains(fitted, share) if described is None else Gains(described, share, fitted)

    def motions(self, tau: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """r(A) for unit gains of commands tau (m, 3): of the plane, north above east, and of yaw."""
        ahead, yaw = self._sampled(self.commands.rotation[:, None] * tau), self._sampled(tau)
        # A force to starboard moves the ship as one ahead does, a right angle further.
        north, east = np.real(ahead), np.imag(ahead)
        plane = {0: np.hstack([north, -east]), 1: np.hstack([east, north])}
        found = np.vstack([self._residual(c, x) for c, x in plane.items()]), self._residual(2, yaw)
        if not all(np.isfinite(part).all() for part in found):  # LAPACK may not end
            raise LinAlgError("the response to its commands is not finite")
        return found

    def motion(self, body: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """r(a) for accelerations in the body frame (m, 3): of the plane (2 n, 1), and of yaw (n, 1)."""
        ahead, starboard, yaw = body.T
        plane = self.commands.rotation * (ahead + 1j * starboard)
        return self._in_plane(plane), self._residual(2, self._sampled(yaw[:, None]))

    def _in_plane(self, a: np.ndarray) -> np.ndarray:
        """r(a) (2 n, 1) for accelerations (m,) in the plane, north its real axis."""
        x = self._sampled(a[:, None])
        return np.vstack([self._residual(0, np.real(x)), self._residual(1, np.imag(x))])

    def _sampled(self, a: np.ndarray) -> np.ndarray:
        """Positions (n, k) in the rows of the pose, by accelerations (m, k) of even steps."""
        time = self.time + self.commands.track.run.time[0]
        return between(time, self.commands.even, self.commands.motion(a)[0])

    def _residual(self, channel: int, x: np.ndarray) -> np.ndarray:
        """r(x) of signals (n, k) in a channel, in units of the noise."""
        system, y = self.fit.systems[channel], self.problem.data(channel, x)
        return system.residual(y, system.solve(y))

    @property
    def block(self) -> np.ndarray:
        """Number of the block of time of each row of r(x).

        Residuals of a spline are correlated over less than its time constant, a second.
        """
        rows = np.concatenate([self.time, middles(self.problem.spline.grid)])
        return np.unique(rows // (WIDTH * self.time_scale), return_inverse=True)[1]


def least_squares(a: np.ndarray, z: np.ndarray, apart: float = DIGITS) -> np.ndarray:
    """x of least |z - a x|; columns that do not differ share their effect evenly.

    Args:
        a, z: (n, k) and (n,).
        apart: share of the largest squared singular value, of columns of length one, below which they
            do not differ.
    """
    size = np.linalg.norm(a, axis=0)
    size[size == 0.0] = np.inf  # what never acts has no effect
    scaled = a / size
    return np.linalg.lstsq(scaled.T @ scaled, scaled.T @ z, rcond=apart)[0] / size


def unlike(a: np.ndarray, z: np.ndarray) -> np.ndarray:
    """x of least |z - a x| of z (n, 1), where motions (n, k) that hardly differ share their effect.

    Side force and yaw moment of a rudder go together; where they differ for once, gains of their
    difference, by which nothing else is explained, would be anything.
    """
    return least_squares(a, z[:, 0], NEGLIGIBLE**2)


def described_gains(commands: Commands) -> np.ndarray:
    """G (3, 3) = M^-1 of the ship's description [1/kg, 1/(kg m), 1/(kg m2)]."""
    return np.linalg.inv(ship(description=commands.track.run.ship).mass)

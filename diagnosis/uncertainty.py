"""How uncertain the model error of each window is, from the noise of the measurement.

In weak form the inertia force of a window is the integral of the pose times the second derivative of the
kernel, and that carries nearly all of the noise. The smoothing spline passes the angular frequency w by
H = 1 / (1 + (w / w0)^6); of noise with the density R it leaves R H uncertain, the jerk that it hides
included (Wiener 1949). w0 follows from the variance of the smoothed pose, which is R w0 / 3, and so is
known at every moment.
"""

import numpy as np

from .weak import NOMINAL, WIDTH, Integrals, kernel

# N, N, N m: below, the arithmetic and the shape of the commands between samples make the difference.
FLOOR = np.array([3e-4, 3e-4, 1e-4])
FREQUENCIES = np.geomspace(0.02, 60.0, 400)  # rad/s
CORNERS = np.geomspace(0.1, 200.0, 80)  # rad/s


def _passed() -> np.ndarray:
    """For each corner frequency: integral of |kernel's second derivative|^2 H over frequency [s-3]."""
    t = np.linspace(-WIDTH / 2, WIDTH / 2, 1201)
    w = kernel(t / (WIDTH / 2)) / (WIDTH / 2)
    transform = np.trapezoid(w * np.cos(FREQUENCIES[:, None] * t), t, axis=1)
    density = FREQUENCIES**4 * transform**2 / np.pi
    H = 1.0 / (1.0 + (FREQUENCIES / CORNERS[:, None]) ** 6)
    return np.asarray(np.trapezoid(density * H, FREQUENCIES, axis=1))


PASSED = _passed()


def omega_std(w: Integrals) -> np.ndarray:
    """Standard deviation of the model error of each window.

    Args:
        w: windows of a run.

    Returns:
        (K, 3) [N, N, N m].
    """
    s = w.smoothed
    used = s.used.astype(float)
    each = np.gradient(s.time)
    # Of a window: how much time one sample stands for, and how sure the smoothed pose is.
    share = np.clip(w.smooth @ (used * s.track.period / np.maximum(each, 1e-9)), 0.05, 1.0)
    density = s.noise**2 * s.track.period / share[:, None]
    sure = w.smooth @ np.where(w.known[:, None], s.eta_std, 0.0) ** 2
    corner = np.clip(3.0 * sure / density, CORNERS[0], CORNERS[-1])
    passed = np.exp(np.interp(np.log(corner), np.log(CORNERS), np.log(PASSED)))
    x, y, psi = (density * passed).T
    turn = s.eta[:, 2]
    c2 = w.smooth @ np.where(w.known, np.cos(turn) ** 2, 0.0)
    ahead, aside = c2 * x + (1.0 - c2) * y, (1.0 - c2) * x + c2 * y
    return np.sqrt(np.column_stack([ahead, aside, psi]) @ (NOMINAL**2).T + FLOOR**2)

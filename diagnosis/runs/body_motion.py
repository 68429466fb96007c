"""Velocity and acceleration of the body by the derivatives of its pose."""

import numpy as np

from fmus.frames import rotate_to_body


def body_velocity(psi: np.ndarray, eta_dot: np.ndarray) -> np.ndarray:
    """Surge, sway and yaw rate nu = R^T(psi) eta_dot, (2.1).

    Args:
        psi: (n,), heading [rad].
        eta_dot: (n, 3), [m/s, m/s, rad/s].

    Returns:
        (n, 3), in the same units.
    """
    return np.column_stack([*rotate_to_body(psi, eta_dot[:, 0], eta_dot[:, 1]), eta_dot[:, 2]])


def body_acceleration(psi: np.ndarray, nu: np.ndarray, eta_ddot: np.ndarray) -> np.ndarray:
    """Derivative of nu, whose axes turn at the yaw rate: nu_dot = R^T(psi) eta_ddot - r S nu.

    Args:
        psi: (n,), heading [rad].
        nu: (n, 3), velocity of the body [m/s, m/s, rad/s].
        eta_ddot: (n, 3), [m/s^2, m/s^2, rad/s^2].

    Returns:
        (n, 3), in the units of ``eta_ddot``.
    """
    u, v, r = nu.T
    ahead, aside = rotate_to_body(psi, eta_ddot[:, 0], eta_ddot[:, 1])
    return np.column_stack([ahead + r * v, aside - r * u, eta_ddot[:, 2]])

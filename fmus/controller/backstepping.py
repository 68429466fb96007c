"""The backstepping law that every controller of the thesis shares, 4.1.1 and Table 4.2.

Convention: omega = -Phi(nu) phi + R^T omega_n is the model error, a force on the hull; its estimate
omega_hat is what the law compensates for. Every heading difference is wrapped.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Annotated, NamedTuple

from ..declare import Declared, Fields, bundle, redeclared
from ..frames import rotate_to_body
from ..hull import Inertia, Triple, inertia_force
from ..ops import Condition, Number, choose, wrap
from ..signals import Estimate, Force, Nothing, Target
from .parametrisation import GAIN, B, Parametrisation, Regressors


class FeedbackGains(NamedTuple):
    """Feedback gains, Table 5.1: diagonals of K_p and K_d."""

    K_p_x: Annotated[float, "1/s", "position gain, along", GAIN] = 0.4
    K_p_y: Annotated[float, "1/s", "position gain, across", GAIN] = 1.0
    K_p_psi: Annotated[float, "1/s", "heading gain", GAIN] = 0.2
    K_d_u: Annotated[float, "N.s/m", "velocity gain, surge", GAIN] = 1.0
    K_d_v: Annotated[float, "N.s/m", "velocity gain, sway", GAIN] = 5.0
    K_d_r: Annotated[float, "N.m.s/rad", "velocity gain, yaw", GAIN] = 1.0


# N, N m; start value of an input that is not connected, for which FMI 2.0 has no other sign: a force
# above half of it is none.
NOT_CONNECTED = 1e9


class Applied(NamedTuple):
    """The force that acts: what was asked for, as the thrusters clipped it."""

    tau_cmd_X: Annotated[float, "N", "optional: surge force that acts; 1e9: not connected"] = (
        NOT_CONNECTED
    )
    tau_cmd_Y: Annotated[float, "N", "optional: sway force that acts; 1e9: not connected"] = (
        NOT_CONNECTED
    )
    tau_cmd_N: Annotated[float, "N.m", "optional: yaw moment that acts; 1e9: not connected"] = (
        NOT_CONNECTED
    )


class Inputs(NamedTuple):
    estimate: Estimate = Estimate()
    target: Target = Target()
    applied: Applied = Applied()


# A ship was moved by the force of the step that ended now, not by the one that is asked for now.
HELD = Applied._fields


def is_connected(applied: Applied) -> Condition:
    """Whether the force that acts is reported on every axis."""
    X, Y, N = applied
    most = 0.5 * NOT_CONNECTED
    return (most > X) & (most > Y) & (most > N)


def acting(applied: Applied, asked: Force) -> Force:
    """The force that acted in the last step: the reported one, or else the one asked for."""
    return choose(is_connected(applied), Force(*applied), asked)


class Errors(NamedTuple):
    """z1 and z2 of (4.1)."""

    z1_x: Annotated[float, "m", "position error along the ship"] = 0.0
    z1_y: Annotated[float, "m", "position error across the ship"] = 0.0
    z1_psi: Annotated[float, "rad", "heading error"] = 0.0
    z2_u: Annotated[float, "m/s", "velocity error, surge"] = 0.0
    z2_v: Annotated[float, "m/s", "velocity error, sway"] = 0.0
    z2_r: Annotated[float, "rad/s", "velocity error, yaw"] = 0.0


class Demand(NamedTuple):
    """The force that a controller asks for, and what it is made of."""

    tau: Force = Force()
    tau_lin_X: Annotated[float, "N", "linear part of the surge force, (5.1)"] = 0.0
    tau_lin_Y: Annotated[float, "N", "linear part of the sway force"] = 0.0
    tau_lin_N: Annotated[float, "N.m", "linear part of the yaw moment"] = 0.0
    tau_nonlin_X: Annotated[float, "N", "nonlinear part of the surge force, (5.1)"] = 0.0
    tau_nonlin_Y: Annotated[float, "N", "nonlinear part of the sway force"] = 0.0
    tau_nonlin_N: Annotated[float, "N.m", "nonlinear part of the yaw moment"] = 0.0
    errors: Errors = Errors()
    omega_hat_X: Annotated[float, "N", "estimated model error in surge"] = 0.0
    omega_hat_Y: Annotated[float, "N", "estimated model error in sway"] = 0.0
    omega_hat_N: Annotated[float, "N.m", "estimated model error in yaw"] = 0.0


class Energy(NamedTuple):
    """The Lyapunov function."""

    lyapunov: Annotated[float, "1", "Lyapunov function of errors and estimates, (4.14)"] = 0.0


def starting(base: Declared, starts: Mapping[str, float]) -> Fields:
    """A group of parameters in a class of its own, with other start values for those that are named."""
    return redeclared(base, lambda v: replace(v, start=starts.get(v.name, v.start)))()


def outputs(model: Parametrisation, learning: tuple[object, ...] = Nothing()) -> type[Fields]:
    """The outputs of a controller with this parametrisation, and what its way of learning shows."""
    return bundle("Outputs", Demand, phi_hat=model.hat(), energy=Energy(), learning=learning)


def control_errors(e: Estimate, t: Target, k: FeedbackGains) -> tuple[Errors, Triple]:
    """z1, z2 and the derivative of the virtual control alpha, Table 4.2.

    Args:
        e: estimated pose [m, m, rad] and velocity [m/s, m/s, rad/s].
        t: target with its derivatives.
        k: feedback gains.

    Returns:
        The errors, and alpha_dot [m/s2, m/s2, rad/s2]; its last term is -K_p z1_dot (corrected).
    """
    u, v, r = e.u_hat, e.v_hat, e.r_hat
    z1_x, z1_y = rotate_to_body(e.psi_hat, e.x_hat - t.x_t, e.y_hat - t.y_t)
    z1_psi = wrap(e.psi_hat - t.psi_t)
    td_x, td_y = rotate_to_body(e.psi_hat, t.x_t_dot, t.y_t_dot)
    tdd_x, tdd_y = rotate_to_body(e.psi_hat, t.x_t_ddot, t.y_t_ddot)
    # S^T(r) turns a body-fixed vector backwards at the yaw rate.
    z1d_x = r * z1_y + u - td_x
    z1d_y = -r * z1_x + v - td_y
    z1d_psi = r - t.psi_t_dot
    return (
        Errors(
            z1_x,
            z1_y,
            z1_psi,
            u - td_x + k.K_p_x * z1_x,
            v - td_y + k.K_p_y * z1_y,
            r - t.psi_t_dot + k.K_p_psi * z1_psi,
        ),
        (
            r * td_y + tdd_x - k.K_p_x * z1d_x,
            -r * td_x + tdd_y - k.K_p_y * z1d_y,
            t.psi_t_ddot - k.K_p_psi * z1d_psi,
        ),
    )


def control(
    model: Parametrisation[B],
    nu: Triple,
    errors: tuple[Errors, Triple],
    k: FeedbackGains,
    controller_model: B,
    F: Regressors,
    phi: Sequence[Number],
    w: Triple,
) -> Demand:
    """The force of Table 4.2, split into its linear and nonlinear part, (5.1).

    Where a loss of thrust is learned, the wanted force is divided by what is left of it, (7.6).

    Args:
        model: what is known and what is learned.
        nu: velocity [m/s, m/s, rad/s].
        errors: z1, z2 and alpha_dot from :func:`control_errors`.
        k: feedback gains.
        controller_model: about the hull.
        F: regressors at this velocity and at alpha_dot.
        phi: estimated parameters.
        w: body-fixed part R^T omega_n_hat of the estimated model error [N, N, N m].

    Returns:
        The force and its parts.
    """
    z, alpha_dot = errors
    MX, MY, MN = inertia_force(*alpha_dot, controller_model.inertia)
    KX, KY, KN = model.known(*nu, controller_model)
    PX, PY, PN = model.force(F, model.without_loss(phi))
    oX, oY, oN = PX + w[0], PY + w[1], PN + w[2]
    lX = -z.z1_x - k.K_d_u * z.z2_u + MX
    lY = -z.z1_y - k.K_d_v * z.z2_v + MY
    lN = -z.z1_psi - k.K_d_r * z.z2_r + MN
    nX, nY, nN = 0.0 - KX - oX, 0.0 - KY - oY, 0.0 - KN - oN  # no -0 at rest
    losses = model.losses(phi)
    if losses is not None:
        left = [1.0 - loss for loss in losses]
        lX, lY, lN = lX / left[0], lY / left[1], lN / left[2]
        nX, nY, nN = nX / left[0], nY / left[1], nN / left[2]
        oX = oX - losses[0] * (lX + nX)
        oY = oY - losses[1] * (lY + nY)
        oN = oN - losses[2] * (lN + nN)
    return Demand(Force(lX + nX, lY + nY, lN + nN), lX, lY, lN, nX, nY, nN, z, oX, oY, oN)


def tracking_energy(z: Errors, inertia: Inertia) -> Number:
    """V2 = 1/2 z1^T z1 + 1/2 z2^T M z2, (4.8)."""
    MX, MY, MN = inertia_force(z.z2_u, z.z2_v, z.z2_r, inertia)
    return 0.5 * (
        z.z1_x * z.z1_x + z.z1_y * z.z1_y + z.z1_psi * z.z1_psi + z.z2_u * MX + z.z2_v * MY + z.z2_r * MN
    )

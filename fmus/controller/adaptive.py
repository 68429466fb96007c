"""Adaptive backstepping with any parametrisation, (4.18): learning by the tracking error alone.

phi_hat' = Gamma F^T z2 and omega_n_hat' = Gamma_omega R z2. An input that is NaN or infinite keeps its
last finite value. With ``hold_frozen`` = 1 nothing is learned while the observer says that its
measurement is frozen.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Annotated, NamedTuple

from ..declare import FIXED, Component, Fields, Range, bundle, redeclared
from ..frames import rotate_to_body, rotate_to_earth
from ..hull import Triple
from ..ops import Condition, Number, choose, not_, where
from ..signals import Estimate, Force
from .backstepping import (
    HELD,
    Energy,
    Errors,
    FeedbackGains,
    Inputs,
    acting,
    control,
    control_errors,
    outputs,
    tracking_energy,
)
from .parametrisation import GAIN, Parametrisation


class Disturbance(NamedTuple):
    """Adaptation to a constant earth-fixed force omega_n by z2: off unless a gain is set."""

    gamma_omega_x: Annotated[float, "N/m", "adaptation gain of the north force", GAIN] = 0.0
    gamma_omega_y: Annotated[float, "N/m", "adaptation gain of the east force", GAIN] = 0.0
    gamma_omega_psi: Annotated[float, "N.m/rad", "adaptation gain of the yaw moment", GAIN] = 0.0


# The same by eps, which is a force.
DisturbanceByError = redeclared(Disturbance, lambda v: replace(v, unit="1/s"))


class OmegaTrue(NamedTuple):
    """The earth-fixed force that the output lyapunov compares with."""

    omega_true_x: Annotated[float, "N", "for the output lyapunov only: north force"] = 0.0
    omega_true_y: Annotated[float, "N", "for the output lyapunov only: east force"] = 0.0
    omega_true_psi: Annotated[float, "N.m", "for the output lyapunov only: moment"] = 0.0


class Learner(NamedTuple):
    """Parameters of every controller that learns, whatever it learns."""

    gains: FeedbackGains = FeedbackGains()
    disturbance: Disturbance = Disturbance()
    hold_frozen: Annotated[float, "1", "1: do not adapt while frozen", FIXED, Range(0.0, 1.0)] = 0.0
    omega_true: OmegaTrue = OmegaTrue()


class State(NamedTuple):
    """Estimates of phi and of the earth-fixed omega_n, and the force asked for last."""

    phi_hat: Fields
    omega: Triple = (0.0, 0.0, 0.0)
    tau: Force = Force()


def parameters(model: Parametrisation, **more: tuple[object, ...]) -> type[Fields]:
    """The Params class of a controller that learns a model."""
    groups = {"controller_model": model.controller_model, "phi": model.start(), "gamma": model.gamma()}
    return bundle("Params", Learner, **groups, truth=model.truth(), **more)


def attentive(e: Estimate, hold_frozen: Number) -> Condition:
    """True unless the observer is frozen and that is a reason not to learn."""
    return not_((e.frozen > 0.5) & (hold_frozen > 0.5))


def to_earth(psi: Number, force: Sequence[Number]) -> Triple:
    """R(psi) of a body-fixed force."""
    return (*rotate_to_earth(psi, force[0], force[1]), force[2])


def to_body(psi: Number, force: Sequence[Number]) -> Triple:
    """R^T(psi) of an earth-fixed force."""
    return (*rotate_to_body(psi, force[0], force[1]), force[2])


def climb(
    values: Sequence[Number], gains: Sequence[Number], slopes: Sequence[Number], dt: Number
) -> tuple[Number, ...]:
    """An explicit Euler step of dt [s] along gains times slopes."""
    return tuple([x + dt * (g * f) for x, g, f in zip(values, gains, slopes, strict=True)])


def energy(z: Errors, p: Fields, phi: Sequence[Number], omega: Triple) -> Energy:
    """V3 of (4.14), corrected; an estimate whose gain is 0 is left out."""
    known = weighted(p.truth, phi, p.gamma) + weighted(p.omega_true, omega, p.disturbance)
    return Energy(tracking_energy(z, p.controller_model.inertia) + 0.5 * known)


def weighted(truth: Sequence[Number], estimates: Sequence[Number], gains: Sequence[Number]) -> Number:
    """Sum of error^2 / gain; a gain of 0 counts as no error."""
    total = 0.0
    for true, estimate, gain in zip(truth, estimates, gains, strict=True):
        error = true - estimate
        total = total + error * error * gain / (gain * gain + 1e-300)
    return total


def adaptive(name: str, description: str, model: Parametrisation) -> Component:
    """A component that tracks, and learns a model by its tracking error."""
    Outputs = outputs(model)

    def init(i: Inputs, p: Fields) -> State:
        return State(model.hat._make(p.phi))

    def step(s: State, i: Inputs, p: Fields, h: Number) -> tuple[State, Fields]:
        e = i.estimate
        nu = (e.u_hat, e.v_hat, e.r_hat)
        z, alpha_dot = errors = control_errors(e, i.target, p.gains)
        F = model.regressors(nu, alpha_dot, acting(i.applied, s.tau), p.controller_model)
        dt = where(attentive(e, p.hold_frozen), h, 0.0)
        z2 = (z.z2_u, z.z2_v, z.z2_r)
        phi = model.hat._make(climb(s.phi_hat, p.gamma, model.project(F, z2), dt))
        a, b, c = climb(s.omega, p.disturbance, to_earth(e.psi_hat, z2), dt)
        omega = (a, b, c)
        w = to_body(e.psi_hat, omega)
        demand = control(model, nu, errors, p.gains, p.controller_model, F, phi, w)
        tau = choose(h > 0.0, demand.tau, s.tau)
        return State(phi, omega, tau), Outputs(*demand, phi, energy(z, p, phi, omega))

    return Component(
        name=name,
        description=description,
        params=parameters(model),
        state=State,
        inputs=Inputs,
        outputs=Outputs,
        init=init,
        step=step,
        held=HELD,
    )

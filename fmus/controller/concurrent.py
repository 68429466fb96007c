"""Concurrent learning, 4.1.2-4.1.5: any parametrisation, any store, driven by z2 or by eps.

y = M nu_dot - known - tau and eps = y - F phi_hat - R^T omega_hat, where tau is the force that acted
while nu_dot was measured: that of the inputs ``tau_cmd``, or where they are not connected the force that
the controller itself asked for last, which may be more than thrusters give. An input that is NaN or
infinite keeps its last finite value.
"""

from typing import Annotated, NamedTuple

from ..declare import POSITIVE, Component, DeclarationError, Fields
from ..hull import Triple
from ..ops import Condition, Number, choose, not_, sqrt, when, where
from ..signals import Force
from .adaptive import Disturbance, DisturbanceByError, attentive, energy, parameters, to_body
from .backstepping import HELD, Inputs, acting, control, control_errors, outputs, starting
from .blocker import Blocker, BlockerOptions, blocked, exceeds
from .eigen import dot
from .fixed_point import FixedPoint, Now, advanced
from .learning import Drive, StoreIntegral, integrated, learned, remembered
from .parametrisation import Parametrisation
from .smoothing import LearningSample, Register, Tap, shifted
from .store import Storage, Store, StoredSample, StoreOptions, empty_store, offer, times


class SampleOptions(NamedTuple):
    """How omega_n is learned, and where samples come from."""

    rho: Annotated[float, "1/s", "omega_n by the integral (4.35); 0: by the store", POSITIVE] = 0.1
    smoothing: Annotated[float, "s", "samples are smoothed over this span; 0: off", POSITIVE] = 0.0
    fixed_point: Annotated[
        float, "s", "stored samples are smoothed with later data within this time; 0: off", POSITIVE
    ] = 0.0


class LearningOutputs(NamedTuple):
    """What concurrent learning shows."""

    stored: Annotated[float, "1", "number of samples in the store"] = 0.0
    sigma_min: Annotated[float, "1", "smallest singular value of the stored regressors"] = 0.0
    rank_met: Annotated[float, "1", "1 where sigma_min is above rank_tolerance, else 0"] = 0.0
    beta: Annotated[float, "1", "1 where learning is allowed, 0 where it is blocked"] = 1.0
    stored_at: Annotated[float, "s", "time of the newest sample in the store"] = 0.0
    by_store: Annotated[float, "1", "norm of the rate of phi_hat by the store"] = 0.0
    by_now: Annotated[float, "1", "norm of the rate of phi_hat by the present error"] = 0.0


class State(NamedTuple):
    phi_hat: Fields
    omega: Triple
    tau: Force
    time: Number
    store: Store
    blocker: Blocker
    register: Register
    integral: StoreIntegral
    point: FixedPoint


class Present(NamedTuple):
    """The sample to learn from, 1 where it counts, and whether it is new."""

    register: Register
    sample: LearningSample
    counts: Number
    fresh: Condition


def present(register: Register, now: LearningSample, span: Number, learns: Condition) -> Present:
    """The sample of this instant, or the smoothed one."""

    def delayed() -> Present:
        tap = Tap(now.time, now.psi, now.nu, now.tau)
        after, full, fresh = shifted(register, tap, span, learns)
        return Present(after, after.sample, where(full, 1.0, 0.0), fresh)

    return when(span > 0.0, delayed, lambda: Present(register, now, 1.0, learns))


def explained(
    model: Parametrisation, sample: LearningSample, s: State, p: Fields
) -> tuple[StoredSample, Triple]:
    """A sample as it is stored, y or as printed eps, and eps = y - F phi_hat - R^T omega_hat, (4.33)."""
    F = model.regressors(sample.nu, sample.nu_dot, sample.tau, p.controller_model)
    y = model.error(sample.nu, sample.nu_dot, sample.tau, p.controller_model)
    a, b = model.force(F, s.phi_hat), to_body(sample.psi, s.omega)
    eps = (y[0] - a[0] - b[0], y[1] - a[1] - b[1], y[2] - a[2] - b[2])
    return StoredSample(1.0, sample.time, sample.psi, choose(p.store.stale > 0.5, eps, y), F), eps


def concurrent(
    name: str,
    description: str,
    model: Parametrisation,
    storage: Storage,
    by_eps: bool,
    **starts: float,
) -> Component:
    """A component that tracks, and learns a model by its past.

    Args:
        name: of the FMU.
        description: of the FMU.
        model: what is known and what is learned.
        storage: which samples are kept.
        by_eps: the instantaneous error is eps, else z2.
        starts: start values of the parameters of store, blocker and samples that differ from the usual.

    Returns:
        The component.
    """
    options = {"store": StoreOptions, "blocker": BlockerOptions, "samples": SampleOptions}
    groups = {name: starting(group, starts) for name, group in options.items()}
    unknown = starts.keys() - {field for group in groups.values() for field in group._fields}
    if unknown:
        raise DeclarationError(
            f"{name} has no {', '.join(sorted(unknown))} with a start value to change"
        )
    # With z2 the law adds forces to a velocity: the gain has the unit for z2, store_weight the rest.
    Params = parameters(model, disturbance=DisturbanceByError() if by_eps else Disturbance(), **groups)
    Outputs = outputs(model, LearningOutputs())
    still: Triple = (0.0, 0.0, 0.0)
    beginning = empty_store(model)
    no_integral = StoreIntegral(0.0, still, (still,) * len(model.coefficients))

    def init(i: Inputs, p: Fields) -> State:
        phi = model.hat._make(p.phi)
        s = State(phi, still, Force(), 0.0, beginning, Blocker(), Register(), no_integral, FixedPoint())
        _, out = step(s, i, p, 0.0)
        return s._replace(tau=out.tau)

    def step(s: State, i: Inputs, p: Fields, h: Number) -> tuple[State, Fields]:
        e = i.estimate
        nu, nu_dot = (e.u_hat, e.v_hat, e.r_hat), (e.u_dot_hat, e.v_dot_hat, e.r_dot_hat)
        z, alpha_dot = errors = control_errors(e, i.target, p.gains)
        acted = acting(i.applied, s.tau)
        F = model.regressors(nu, alpha_dot, acted, p.controller_model)

        gate = blocked(s.blocker, exceeds(nu, nu_dot, acted, p.blocker), p.blocker.block_time, h)
        learns = (h > 0.0) & (gate.beta > 0.5) & attentive(e, p.hold_frozen)
        dt = where(learns, h, 0.0)
        time = s.time + h
        now = LearningSample(time, e.psi_hat, nu, nu_dot, acted)
        register, sample, counts, fresh = when(
            h > 0.0,
            lambda: present(s.register, now, p.samples.smoothing, learns),
            lambda: Present(s.register, now, 0.0, False),
        )
        row, eps = explained(model, sample, s, p)

        omega_on = dot(p.disturbance, (1.0, 1.0, 1.0)) > 0.0

        def smoothed_row() -> tuple[FixedPoint, StoredSample, Condition]:
            pose = (e.x_hat, e.y_hat, e.psi_hat)
            seen = learns & not_(e.frozen > 0.5)
            new = Now(time, pose, nu, acted)
            point, past, ready = advanced(
                model, p.controller_model, s.point, new, p.samples.fixed_point, h, seen
            )
            return point, explained(model, past, s, p)[0], ready

        point, offered, ready = when(
            (h > 0.0) & (p.samples.fixed_point > 0.0), smoothed_row, lambda: (s.point, row, fresh)
        )
        kept = offer(model, storage, s.store, offered, ready, time, p.store, omega_on)
        integral = when(
            omega_on & (p.samples.rho > 0.0),
            lambda: integrated(model, s.integral, row, dt * counts),
            lambda: s.integral,
        )
        sums = s.store.sums
        memory = when(
            omega_on,
            lambda: remembered(sums, integral, p.samples.rho, p.store.store_weight),
            lambda: no_integral,
        )
        if by_eps:
            drive = Drive(row.F, sample.psi, times(counts, eps))
        else:
            drive = Drive(F, e.psi_hat, (z.z2_u, z.z2_v, z.z2_r))
        phi, omega, rates = learned(
            model,
            (s.phi_hat, s.omega),
            (p.gamma, p.disturbance),
            drive,
            1.0 if by_eps else 0.0,
            sums,
            memory,
            p.store,
            dt,
        )

        demand = control(
            model, nu, errors, p.gains, p.controller_model, F, phi, to_body(e.psi_hat, omega)
        )
        sigma = sqrt(kept.sums.least)
        count = kept.sums.count
        met = where((count > 0.5) & (sigma > p.store.rank_tolerance), 1.0, 0.0)
        tau = choose(h > 0.0, demand.tau, s.tau)
        return (
            State(phi, omega, tau, time, kept, gate, register, integral, point),
            Outputs(
                *demand,
                phi,
                energy(z, p, phi, omega),
                LearningOutputs(count, sigma, met, gate.beta, kept.sums.newest, *rates),
            ),
        )

    return Component(
        name=name,
        description=description,
        params=Params,
        state=State,
        inputs=Inputs,
        outputs=Outputs,
        init=init,
        step=step,
        held=HELD,
    )

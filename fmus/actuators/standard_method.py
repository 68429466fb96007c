"""Propeller and rudder of the MMG standard method.

H. Yasukawa and Y. Yoshimura, J. Mar. Sci. Technol. 20, 2015. The
propeller is behind the hull, whose wake it leaves as the ship drifts; the rudder is in its race, and the
hull straightens the flow across the rudder. The angle of drift, beta = atan2(-v, u), is that of the
ship's origin.
"""

from typing import Annotated, Any, NamedTuple

from ..declare import POSITIVE, Range, group_of, variables
from ..ops import Number, atan2, exp, fmax, fmin, sqrt, where
from .law import Change, Flow, Law
from .laws import DIVISOR, SMALL, OpenWater, OpenWaterPropeller, RudderForce


class DriftWake(NamedTuple):
    """How drift takes the wake away."""

    C_1: Annotated[float, "1", "rate at which drift at the propeller reduces the wake", POSITIVE] = 2.0
    C_2_plus: Annotated[float, "1", "1 - w in large drift over that without drift, drift to port"] = 1.0
    C_2_minus: Annotated[
        float, "1", "1 - w in large drift over that without drift, drift to starboard"
    ] = 1.0


class PropellerBehindHull(OpenWaterPropeller):
    """Propeller in a wake that goes as the ship drifts.

    1 - w = (1 - w_P0) (1 + (1 - exp(-C1 |beta_P|)) (C2 - 1)), beta_P = beta - x_P r / U.
    """

    name = "propeller_behind_hull"
    changes = (
        Change("wake", ("wake",), "wake"),
        Change("thrust_deduction", ("thrust_deduction",), "thrust deduction"),
        Change("drift_wake", ("C_2_plus", "C_2_minus"), "wake in drift"),
    )
    Parameters = group_of("BehindHull", [*variables(OpenWater), *variables(DriftWake)])

    @classmethod
    def advance(cls, flow: Flow, p: Any) -> Number:
        speed = sqrt(flow.hull_u * flow.hull_u + flow.hull_v * flow.hull_v)
        turning = (flow.v - flow.hull_v) / fmax(speed, SMALL)
        beta = atan2(-flow.hull_v, flow.hull_u) - turning
        most = where(beta > 0.0, p.C_2_plus, p.C_2_minus)
        gone = (1.0 - exp(-p.C_1 * abs(beta))) * (most - 1.0)
        return (1.0 - p.wake) * (1.0 + gone) * flow.u


class RaceFoil(NamedTuple):
    """Parameters of :class:`RudderInRace`."""

    area: Annotated[float, "m2", "area of the rudder", DIVISOR] = 0.01
    span: Annotated[float, "m", "height of the rudder, H_R", DIVISOR] = 0.1
    lift: Annotated[float, "1", "slope of the normal force's coefficient, f_alpha", DIVISOR] = 2.5
    delta_max: Annotated[float, "rad", "largest angle to either side", POSITIVE] = 0.61
    steering_deduction: Annotated[float, "1", "t_R, reduction of the rudder resistance by the hull"] = (
        0.0
    )
    hull_force: Annotated[
        float, "1", "a_H, force of the rudder on the hull, relative to its normal force"
    ] = 0.0
    hull_force_place: Annotated[float, "m", "x_H, where the force on the hull acts"] = 0.0
    inflow: Annotated[float, "1", "epsilon, 1 - w at the rudder over that at the propeller", DIVISOR] = (
        1.0
    )
    race: Annotated[
        float, "1", "kappa, share of its final speed that the slipstream has reached", Range(-1.0, 2.0)
    ] = 0.5
    gamma_plus: Annotated[float, "1", "gamma_R, flow straightening, drift at the rudder to port"] = 1.0
    gamma_minus: Annotated[float, "1", "gamma_R, flow straightening, drift to starboard"] = 1.0
    inflow_lever: Annotated[float, "m", "l_R, lever of the yaw rate in the flow across the rudder"] = 0.0
    bias: Annotated[float, "rad", "angle of the rudder at the command 0", Range(-0.5, 0.5)] = 0.0
    water_density: Annotated[float, "kg/m3", "density of the water", POSITIVE] = 1000.0


def covered(diameter: Number, span: Number) -> Number:
    """eta, share of a rudder's span [m] in the race of a propeller of a diameter [m]."""
    return fmin(diameter / span, 1.0)


class RudderInRace(RudderForce, Law[RaceFoil]):
    """Rudder in the race of a propeller.

    u_R = epsilon u (1 - w) sqrt(eta (1 + kappa (sqrt(1 + 8 K_T / (pi J^2)) - 1))^2 + 1 - eta) with
    eta = min(D / H_R, 1), and v_R = U gamma_R (beta - l_R r / U). F_N, X_R, Y_R and N_R follow.
    A positive angle of a rudder aft turns a ship that goes ahead to starboard. It is not asked for
    force, which would be that of the propeller's speed at the time.
    """

    name = "rudder_in_race"
    in_race = True
    changes = (
        Change("inflow_speed", ("inflow",), "wake at the rudder"),
        Change("race", ("race",), "speed of the slipstream at the rudder"),
        Change("straightening", ("gamma_plus", "gamma_minus"), "flow straightening at the rudder"),
        Change("inflow_lever", ("inflow_lever",), "cross-flow by the yaw rate at the rudder"),
        Change("bias", ("bias",), "angle at the command 0"),
        Change("hull_force", ("hull_force",), "force on the hull by the rudder"),
    )
    Parameters = RaceFoil

    @classmethod
    def acts_at(cls, x: Number, p: RaceFoil) -> Number:
        """Where rudder and hull together have their force."""
        return (x + p.hull_force * p.hull_force_place) / (1.0 + p.hull_force)

    @classmethod
    def met(cls, flow: Flow, p: RaceFoil) -> tuple[Number, Number]:
        """u_R along the ship and v_R, positive from port, of the water that meets the rudder [m/s]."""
        assert flow.race is not None
        inflow, jet, diameter = flow.race[:3]
        eta = covered(diameter, p.span)
        raced = inflow + p.race * (jet - inflow)
        speed = sqrt(eta * raced * raced + (1.0 - eta) * inflow * inflow)
        u = p.inflow * where(raced < 0.0, -speed, speed)
        moving = sqrt(flow.hull_u * flow.hull_u + flow.hull_v * flow.hull_v)
        across = moving * atan2(-flow.hull_v, flow.hull_u) - p.inflow_lever * flow.r
        return u, where(across > 0.0, p.gamma_plus, p.gamma_minus) * across

"""The laws of actuators that descriptions may name."""

from collections.abc import Mapping
from math import pi
from typing import Annotated, Any, ClassVar, NamedTuple

from ..declare import POSITIVE, Range
from ..effects.families import PROPELLERS, TUNNEL_THRUSTER
from ..ops import Number, atan2, clip, cos, fmax, fmin, power, signed_root, sin, sqrt, where
from ..ship_description import Part
from .law import Change, Command, Flow, Law, Race, Span

DIVISOR = Range(min=1e-6)
ASTERN = Range(max=0.0)
SMALL = 1e-12  # in place of zero, by which nothing can be divided
QUARTER = 1.5707963267948966  # of a turn [rad]
SHAFT_SPEED = Command("n", "1/s", "shaft speed")


class Bollard(NamedTuple):
    """Thrust by the square of the shaft speed, as pulled at a bollard."""

    k_ahead: Annotated[float, "N.s2", "thrust ahead by n^2", DIVISOR] = 1.0
    k_astern: Annotated[float, "N.s2", "thrust astern by n^2", DIVISOR] = 1.0
    n_max: Annotated[float, "1/s", "highest shaft speed", POSITIVE] = 1.0
    n_min: Annotated[float, "1/s", "lowest shaft speed, negative where it turns astern", ASTERN] = -1.0


def bollard_thrust(n: Number, p: "Bollard | Azimuth") -> Number:
    """Thrust [N] by the square of the shaft speed n [1/s]."""
    return where(n > 0.0, p.k_ahead, p.k_astern) * n * abs(n)


def bollard_speed(thrust: Number, p: "Bollard | Azimuth") -> Number:
    """The shaft speed [1/s] that gives a thrust [N]."""
    return signed_root(thrust / where(thrust > 0.0, p.k_ahead, p.k_astern))


class OnShaft:
    """What propellers on a fixed shaft have in common: one command, and a force along the ship."""

    commands = (SHAFT_SPEED,)
    components = "X"

    @classmethod
    def limits(cls, p: "Bollard | OpenWater") -> tuple[Span, ...]:
        return ((p.n_min, p.n_max),)


class RudderForce:
    """What rudders have in common: an angle, and a normal force by the square of the flow."""

    commands = (Command("delta", "rad", "rudder angle"),)
    pushes = "XY"
    limiting = ("delta_max",)

    @classmethod
    def limits(cls, p: Any) -> tuple[Span, ...]:
        return ((-p.delta_max, p.delta_max),)

    @classmethod
    def force(cls, commands: tuple[Number, ...], flow: Flow, p: Any) -> tuple[Number, Number]:
        delta = commands[0] + p.bias
        u, v = cls.met(flow, p)
        normal = 0.5 * p.water_density * p.area * p.lift * sqrt(u * u + v * v)
        # Astern as well the angle of the flow is delta - arctan(v / u).
        normal = normal * (u * sin(delta) - v * cos(delta))
        along = (1.0 - p.steering_deduction) * normal * sin(delta)
        return -along, -(1.0 + p.hull_force) * normal * cos(delta)

    @classmethod
    def met(cls, flow: Flow, p: Any) -> tuple[Number, Number]:
        """Velocity of the water that meets it along the ship, and from port [m/s]."""
        raise NotImplementedError


class FixedPropeller(OnShaft, Law[Bollard]):
    """Propeller on a fixed shaft, whose thrust is that at a bollard."""

    name = "fixed_propeller"
    Parameters = Bollard

    @classmethod
    def force(cls, commands: tuple[Number, ...], flow: Flow, p: Bollard) -> tuple[Number, Number]:
        (n,) = commands
        return bollard_thrust(n, p), 0.0 * n

    @classmethod
    def reach(cls, flow: Flow, p: Bollard) -> tuple[Span, ...]:
        return ((bollard_thrust(p.n_min, p), bollard_thrust(p.n_max, p)),)

    @classmethod
    def commanded(cls, forces: tuple[Number, ...], flow: Flow, p: Bollard) -> tuple[Number, ...]:
        return (bollard_speed(forces[0], p),)


class OpenWater(NamedTuple):
    """K_T = K_T0 + K_T1 J + K_T2 J^2, J = (1 - w) u / (n D)."""

    diameter: Annotated[float, "m", "diameter of the propeller", DIVISOR] = 0.1
    K_T0: Annotated[float, "1", "thrust coefficient at a bollard", DIVISOR] = 0.4
    K_T1: Annotated[float, "1", "its slope over the advance ratio"] = 0.0
    K_T2: Annotated[float, "1", "its curvature over the advance ratio"] = 0.0
    wake: Annotated[float, "1", "wake fraction w_P", Range(-0.5, 0.9)] = 0.0
    thrust_deduction: Annotated[float, "1", "thrust deduction fraction t", Range(-0.5, 0.9)] = 0.0
    astern: Annotated[float, "1", "thrust astern, as a share of that ahead", DIVISOR] = 1.0
    water_density: Annotated[float, "kg/m3", "density of the water", POSITIVE] = 1025.0
    n_max: Annotated[float, "1/s", "highest shaft speed", POSITIVE] = 1.0
    n_min: Annotated[float, "1/s", "lowest shaft speed, negative where it turns astern", ASTERN] = -1.0


def square_by_coefficient(n: Number, advance: Number, p: OpenWater) -> Number:
    """n |n| K_T(J) [1/s2], multiplied out, so that a propeller at rest needs no J.

    Args:
        n: shaft speed [1/s].
        advance: speed of the water that meets the propeller [m/s].
        p: an :class:`OpenWater`.
    """
    square = p.K_T0 * n * abs(n)
    slope = p.K_T1 * advance * abs(n) / p.diameter
    rest = p.K_T2 * advance * advance / (p.diameter * p.diameter)
    found = where(n < 0.0, p.astern * (square + slope), square + slope + rest)
    return where(n == 0.0, 0.0 * n, found)


class OpenWaterPropeller(OnShaft, Law[OpenWater]):
    """Propeller with an open-water curve, wake and thrust deduction (Yasukawa and Yoshimura 2015)."""

    name = "open_water_propeller"
    has_race = True
    measurable: ClassVar[Mapping[str, str]] = {"thrust": "N"}
    Parameters = OpenWater

    @classmethod
    def advance(cls, flow: Flow, p: OpenWater) -> Number:
        """Speed of the water [m/s] that meets the propeller."""
        return (1.0 - p.wake) * flow.u

    @classmethod
    def coefficient(cls, n: Number, flow: Flow, p: OpenWater) -> Number:
        """n |n| K_T [1/s2]: thrust over rho D^4."""
        return square_by_coefficient(n, cls.advance(flow, p), p)

    @classmethod
    def force(cls, commands: tuple[Number, ...], flow: Flow, p: OpenWater) -> tuple[Number, Number]:
        (n,) = commands
        thrust = cls.coefficient(n, flow, p)
        return (1.0 - p.thrust_deduction) * p.water_density * power(p.diameter, 4.0) * thrust, 0.0 * n

    @classmethod
    def output(cls, name: str, commands: tuple[Number, ...], flow: Flow, p: OpenWater) -> Number:
        (n,) = commands
        return p.water_density * power(p.diameter, 4.0) * cls.coefficient(n, flow, p)

    @classmethod
    def race(cls, commands: tuple[Number, ...], flow: Flow, p: OpenWater) -> Race:
        """By momentum theory, V sqrt(1 + 8 K_T / (pi J^2)), multiplied out."""
        (n,) = commands
        inflow = cls.advance(flow, p)
        added = 8.0 / pi * p.diameter * p.diameter * cls.coefficient(n, flow, p)
        jet = signed_root(inflow * abs(inflow) + added)
        return Race(inflow, jet, p.diameter, added, n)

    @classmethod
    def reach(cls, flow: Flow, p: OpenWater) -> tuple[Span, ...]:
        low, _ = cls.force((p.n_min,), flow, p)
        high, _ = cls.force((p.n_max,), flow, p)
        return ((fmin(0.0, low), fmax(0.0, high)),)

    @classmethod
    def commanded(cls, forces: tuple[Number, ...], flow: Flow, p: OpenWater) -> tuple[Number, ...]:
        wanted = forces[0] / ((1.0 - p.thrust_deduction) * p.water_density * power(p.diameter, 4.0))
        advance = cls.advance(flow, p)
        slope = p.K_T1 * advance / p.diameter
        rest = p.K_T2 * advance * advance / (p.diameter * p.diameter) - wanted
        ahead = (-slope + sqrt(fmax(0.0, slope * slope - 4.0 * p.K_T0 * rest))) / (2.0 * p.K_T0)
        back = fmax(0.0, slope * slope - 4.0 * p.K_T0 * wanted / p.astern)
        astern = (-slope - sqrt(back)) / (2.0 * p.K_T0)
        return (where(wanted < 0.0, fmin(0.0, astern), fmax(0.0, ahead)),)


class Tunnel(NamedTuple):
    F: Annotated[float, "N", "force to starboard at full command", DIVISOR] = 1.0


class TunnelThruster(Law[Tunnel]):
    """Thruster in a tunnel across the ship, whose force is linear in its command."""

    name = "tunnel_thruster"
    strength = "F"
    commands = (Command("u", "1", "command, -1...1"),)
    components = "Y"
    powered = True
    proportional = True
    family = TUNNEL_THRUSTER
    variants: ClassVar[Mapping[str, str]] = {
        "squared": "squared_tunnel_thruster",
        "table": "tabulated_tunnel_thruster",
    }
    Parameters = Tunnel

    @classmethod
    def limits(cls, p: Tunnel) -> tuple[Span, ...]:
        return ((-1.0, 1.0),)

    @classmethod
    def force(cls, commands: tuple[Number, ...], flow: Flow, p: Tunnel) -> tuple[Number, Number]:
        (u,) = commands
        return 0.0 * u, p.F * u

    @classmethod
    def reach(cls, flow: Flow, p: Tunnel) -> tuple[Span, ...]:
        return ((-p.F, p.F),)

    @classmethod
    def commanded(cls, forces: tuple[Number, ...], flow: Flow, p: Tunnel) -> tuple[Number, ...]:
        return (forces[0] / p.F,)


class Cycloidal(NamedTuple):
    F: Annotated[float, "N", "force to starboard at full command", DIVISOR] = 1.0
    P_idle: Annotated[float, "W", "power at no command", POSITIVE] = 0.0
    P_full: Annotated[float, "W", "power at full command, at rest; 0: not known", POSITIVE] = 0.0


class VoithSchneider(Law[Cycloidal]):
    """Voith Schneider propeller: a force in any direction, linear in two commands, (2.10).

    Its power, (2.12), grows from idle with the force to 3/2, as that of an ideal propeller at rest does.
    """

    name = "voith_schneider"
    strength = "F"
    commands = (
        Command("surge", "1", "command in surge, -1...1"),
        Command("sway", "1", "command in sway, -1...1"),
    )
    components = "XY"
    by_axis = True
    powered = True
    proportional = True
    family = PROPELLERS
    variants: ClassVar[Mapping[str, str]] = {
        "squared": "squared_voith_schneider",
        "table": "tabulated_voith_schneider",
    }
    Parameters = Cycloidal
    limiting = ("P_idle", "P_full")  # no part of the force, which is fitted
    measurable: ClassVar[Mapping[str, str]] = {"power": "W"}

    @classmethod
    def limits(cls, p: Cycloidal) -> tuple[Span, ...]:
        return ((-1.0, 1.0), (-1.0, 1.0))

    @classmethod
    def force(cls, commands: tuple[Number, ...], flow: Flow, p: Cycloidal) -> tuple[Number, Number]:
        surge, sway = commands
        return p.F * surge, p.F * sway

    @classmethod
    def reach(cls, flow: Flow, p: Cycloidal) -> tuple[Span, ...]:
        return ((-p.F, p.F), (-p.F, p.F))

    @classmethod
    def commanded(cls, forces: tuple[Number, ...], flow: Flow, p: Cycloidal) -> tuple[Number, ...]:
        return forces[0] / p.F, forces[1] / p.F

    @classmethod
    def measured(cls, part: Part) -> Mapping[str, str]:
        return cls.measurable if part.number("P_full") > 0.0 else {}

    @classmethod
    def output(cls, name: str, commands: tuple[Number, ...], flow: Flow, p: Cycloidal) -> Number:
        surge, sway = commands
        share = fmin(1.0, sqrt(surge * surge + sway * sway))
        return p.P_idle + (p.P_full - p.P_idle) * share * sqrt(share)


class Azimuth(NamedTuple):
    k_ahead: Annotated[float, "N.s2", "thrust by n^2", DIVISOR] = 1.0
    k_astern: Annotated[float, "N.s2", "thrust by n^2 where it turns backwards", DIVISOR] = 1.0
    n_max: Annotated[float, "1/s", "highest shaft speed", POSITIVE] = 1.0
    n_min: Annotated[float, "1/s", "lowest shaft speed, negative where it turns backwards", ASTERN] = 0.0
    alpha_max: Annotated[float, "rad", "largest angle to either side", POSITIVE] = 3.2


class AzimuthThruster(Law[Azimuth]):
    """Propeller that turns about a vertical axis: its thrust at a bollard, at an angle from ahead."""

    name = "azimuth"
    commands = (
        Command("alpha", "rad", "angle of the thrust, from ahead to starboard", "alpha_max"),
        SHAFT_SPEED,
    )
    components = "XY"
    limiting = ("n_max", "n_min", "alpha_max")
    Parameters = Azimuth

    @classmethod
    def limits(cls, p: Azimuth) -> tuple[Span, ...]:
        return ((-p.alpha_max, p.alpha_max), (p.n_min, p.n_max))

    @classmethod
    def force(cls, commands: tuple[Number, ...], flow: Flow, p: Azimuth) -> tuple[Number, Number]:
        alpha, n = commands
        thrust = bollard_thrust(n, p)
        return thrust * cos(alpha), thrust * sin(alpha)

    @classmethod
    def reach(cls, flow: Flow, p: Azimuth) -> tuple[Span, ...]:
        most, least = bollard_thrust(p.n_max, p), bollard_thrust(p.n_min, p)
        aside = most * sin(fmin(p.alpha_max, QUARTER))
        return ((where(p.alpha_max > QUARTER, -most, least), most), (-aside, aside))

    @classmethod
    def commanded(cls, forces: tuple[Number, ...], flow: Flow, p: Azimuth) -> tuple[Number, ...]:
        # One that cannot turn round runs backwards; beyond its angles it gives what it can of the force.
        X, Y = forces
        way = where((p.alpha_max <= QUARTER) & (X < 0.0), -1.0, 1.0)
        alpha = clip(atan2(way * Y, way * X), -p.alpha_max, p.alpha_max)
        thrust = X * cos(alpha) + Y * sin(alpha)
        most, least = bollard_thrust(p.n_max, p), bollard_thrust(p.n_min, p)
        return alpha, bollard_speed(clip(thrust, least, most), p)


class Foil(NamedTuple):
    area: Annotated[float, "m2", "area of the rudder", DIVISOR] = 0.01
    lift: Annotated[float, "1/rad", "slope of the normal force's coefficient, f_alpha", DIVISOR] = 2.5
    delta_max: Annotated[float, "rad", "largest angle to either side", POSITIVE] = 0.61
    wake: Annotated[float, "1", "wake fraction at the rudder", Range(-0.5, 0.9)] = 0.0
    steering_deduction: Annotated[float, "1", "t_R, reduction of the rudder resistance by the hull"] = (
        0.0
    )
    hull_force: Annotated[
        float, "1", "a_H, force of the rudder on the hull, relative to its normal force"
    ] = 0.0
    bias: Annotated[float, "rad", "angle of the rudder at the command 0", Range(-0.5, 0.5)] = 0.0
    water_density: Annotated[float, "kg/m3", "density of the water", POSITIVE] = 1025.0


class Rudder(RudderForce, Law[Foil]):
    """Rudder in a free flow: a normal force by the square of the flow (Yasukawa and Yoshimura 2015).

    A positive angle of a rudder aft turns a ship that goes ahead to starboard. What it is asked for is
    the sway force of its angle; what drift adds is left to the ship, as the force on its hull is.
    """

    name = "rudder"
    components = "Y"
    changes = (Change("bias", ("bias",), "angle at the command 0"),)
    Parameters = Foil

    @classmethod
    def met(cls, flow: Flow, p: Foil) -> tuple[Number, Number]:
        return (1.0 - p.wake) * flow.u, -flow.v

    @staticmethod
    def _full(flow: Flow, p: Foil) -> Number:
        """Sway force [N] at an angle of 45 degrees, without drift."""
        return Rudder.force((0.5 * QUARTER - p.bias,), Flow(flow.u, 0.0), p)[1]

    @classmethod
    def reach(cls, flow: Flow, p: Foil) -> tuple[Span, ...]:
        full, half = Rudder._full(flow, p), 0.5 * QUARTER
        a, b = (full * sin(2.0 * clip(side * p.delta_max + p.bias, -half, half)) for side in (-1.0, 1.0))
        return ((fmin(a, b), fmax(a, b)),)

    @classmethod
    def commanded(cls, forces: tuple[Number, ...], flow: Flow, p: Foil) -> tuple[Number, ...]:
        # The force goes with sin(2 delta).
        full = Rudder._full(flow, p)
        sine = clip(forces[0] / where(abs(full) > SMALL, full, SMALL), -1.0, 1.0)
        return (0.5 * atan2(sine, sqrt(1.0 - sine * sine)) - p.bias,)


class LargestForces(NamedTuple):
    F_X: Annotated[float, "N", "largest force ahead and astern", DIVISOR] = 1.0
    F_Y: Annotated[float, "N", "largest force to starboard and port", DIVISOR] = 1.0


class ExternalForce(Law[LargestForces]):
    """A force that is given, as a tug's or a winch's."""

    name = "given_force"
    commands = (Command("X", "N", "force ahead"), Command("Y", "N", "force to starboard"))
    components = "XY"
    Parameters = LargestForces

    @classmethod
    def limits(cls, p: LargestForces) -> tuple[Span, ...]:
        return ((-p.F_X, p.F_X), (-p.F_Y, p.F_Y))

    @classmethod
    def force(cls, commands: tuple[Number, ...], flow: Flow, p: LargestForces) -> tuple[Number, Number]:
        return commands[0], commands[1]

    @classmethod
    def reach(cls, flow: Flow, p: LargestForces) -> tuple[Span, ...]:
        return ExternalForce.limits(p)

    @classmethod
    def commanded(cls, forces: tuple[Number, ...], flow: Flow, p: LargestForces) -> tuple[Number, ...]:
        return forces

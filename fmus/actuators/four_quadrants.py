"""Propeller and rudder in four quadrants: shaft and ship ahead and astern, and at rest.

The parts of the MMG low-speed model as R. Miyauchi et al. publish them (J. Mar. Sci. Technol. 27, 2022):
thrust and side force of a propeller that turns astern by the polynomials of Ueno and of Hachii in
J_s = u / (n D), the rudder behind it by Kitagawa. All of it is multiplied out, so that neither a shaft
nor a ship at rest needs an advance ratio. A shaft at rest has no force, and leaves the rudder the flow.
"""

from collections.abc import Sequence
from typing import Annotated, Any, NamedTuple

from ..declare import POSITIVE, Range, group_of, variables
from ..ops import Number, clip, fmax, power, signed_root, sqrt, where
from .law import Change, Flow, Span
from .laws import SMALL, OpenWater, OpenWaterPropeller
from .standard_method import RaceFoil, RudderInRace, covered


class Quadrants(NamedTuple):
    """Wake by drift, and polynomials of a shaft or a ship that goes astern, by their published names."""

    wake_slope: Annotated[float, "1", "change of the wake with the drift at the propeller"] = 0.0
    wake_curve: Annotated[float, "1", "change of the wake with the square of that drift"] = 0.0
    C_3: Annotated[float, "1", "shaft astern: force coefficient where J_s < C_10"] = -0.25
    C_6: Annotated[float, "1", "shaft astern: force coefficient at a bollard"] = -0.175
    C_7: Annotated[float, "1", "shaft astern: its slope over J_s"] = 0.33
    C_10: Annotated[float, "1", "J_s below which the force astern is C_3", Range(max=0.0)] = -0.233
    pitch: Annotated[float, "m", "pitch of the propeller", POSITIVE] = 0.0
    hull_length: Annotated[float, "m", "length L of the hull in front of it", POSITIVE] = 1.0
    hull_draft: Annotated[float, "m", "draft d of that hull", POSITIVE] = 0.1
    J_syo: Annotated[float, "1", "J_s below which A_3, A_4, B_3, B_4 hold", Range(max=0.0)] = -0.35
    J_syo0: Annotated[float, "1", "J_s above which A_5 and B_5 hold", Range(max=0.0)] = -0.06
    A_1: Annotated[float, "1", "shaft astern: sway force between J_syo and J_syo0"] = 0.0
    A_2: Annotated[float, "1", "shaft astern: its slope over J_s"] = 0.0
    A_3: Annotated[float, "1", "shaft astern: sway force below J_syo"] = 0.0
    A_4: Annotated[float, "1", "shaft astern: its slope over J_s"] = 0.0
    A_5: Annotated[float, "1", "shaft astern: sway force above J_syo0"] = 0.0
    A_6: Annotated[float, "1", "ship astern, shaft ahead: sway force, J_s^2"] = 0.0
    A_7: Annotated[float, "1", "ship astern, shaft ahead: sway force, J_s"] = 0.0
    A_8: Annotated[float, "1", "ship astern, shaft ahead: sway force at rest"] = 0.0
    B_1: Annotated[float, "1", "shaft astern: yaw moment between J_syo and J_syo0"] = 0.0
    B_2: Annotated[float, "1", "shaft astern: its slope over J_s"] = 0.0
    B_3: Annotated[float, "1", "shaft astern: yaw moment below J_syo"] = 0.0
    B_4: Annotated[float, "1", "shaft astern: its slope over J_s"] = 0.0
    B_5: Annotated[float, "1", "shaft astern: yaw moment above J_syo0"] = 0.0
    B_6: Annotated[float, "1", "ship astern, shaft ahead: yaw moment, J_s^2"] = 0.0
    B_7: Annotated[float, "1", "ship astern, shaft ahead: yaw moment, J_s"] = 0.0
    B_8: Annotated[float, "1", "ship astern, shaft ahead: yaw moment at rest"] = 0.0


class FourQuadrantPropeller(OpenWaterPropeller):
    """Propeller that turns ahead and astern behind a ship that goes ahead and astern.

    Ahead, K_T is that of an open-water curve, in a wake w + w_1 |v_P / U| + w_2 (v_P / U)^2 while the
    ship goes ahead, v_P the sway velocity at the propeller. The force of a shaft astern is that on the
    hull.
    """

    name = "four_quadrant_propeller"
    components = ""
    pushes = "XY"
    has_couple = True
    changes = (
        Change("wake", ("wake",), "wake"),
        Change("thrust_deduction", ("thrust_deduction",), "thrust deduction"),
        Change("drift_wake", ("wake_slope", "wake_curve"), "wake in drift"),
        Change("astern", ("C_3", "C_6", "C_7"), "force of the shaft astern"),
        Change("side_force", ("A_1", "A_3", "A_5"), "sway force of the shaft astern"),
        Change("side_moment", ("B_1", "B_3", "B_5"), "yaw moment of the shaft astern"),
    )
    Parameters = group_of(
        "FourQuadrants",
        [*[v for v in variables(OpenWater) if v.name != "astern"], *variables(Quadrants)],
    )

    @classmethod
    def advance(cls, flow: Flow, p: Any) -> Number:
        speed = sqrt(flow.hull_u * flow.hull_u + flow.hull_v * flow.hull_v)
        drift = abs(flow.v) / fmax(speed, SMALL)
        wake = p.wake + drift * (p.wake_slope + drift * p.wake_curve)
        return where(flow.u > 0.0, clip(1.0 - wake, 0.0, 1.0), 1.0) * flow.u

    @classmethod
    def coefficient(cls, n: Number, flow: Flow, p: Any) -> Number:
        """n^2 K_T [1/s2], of a shaft astern with the sign of its force on the hull."""
        inflow, slide = cls.advance(flow, p) / p.diameter, flow.u / p.diameter
        ahead = p.K_T0 * n * n + p.K_T1 * inflow * n + p.K_T2 * inflow * inflow
        falling = p.C_6 * n * n + p.C_7 * slide * n
        astern = where(slide <= p.C_10 * n, falling, p.C_3 * n * n)
        return where(n > 0.0, ahead, where(n < 0.0, astern, 0.0 * ahead))

    @classmethod
    def force(cls, commands: tuple[Number, ...], flow: Flow, p: Any) -> tuple[Number, Number]:
        (n,) = commands
        felt = where(n < 0.0, 1.0, 1.0 - p.thrust_deduction)
        X = felt * p.water_density * power(p.diameter, 4.0) * cls.coefficient(n, flow, p)
        return X, cls._aside(n, flow, p, p[-16:-8])

    @classmethod
    def couple(cls, commands: tuple[Number, ...], flow: Flow, p: Any) -> Number:
        (n,) = commands
        return p.hull_length * cls._aside(n, flow, p, p[-8:])

    @staticmethod
    def _aside(n: Number, flow: Flow, p: Any, c: Sequence[Number]) -> Number:
        """1/2 rho L d (n D)^2, or of a shaft ahead (n P)^2, times the polynomial of a quadrant [N]."""
        c_1, c_2, c_3, c_4, c_5, c_6, c_7, c_8 = c
        turned, slide = n * p.diameter, flow.u
        middle = (c_1 * turned + c_2 * slide) * turned
        low = (c_3 * turned + c_4 * slide) * turned
        # J_s < J_syo is u > J_syo n D, as n < 0.
        astern = where(slide > p.J_syo * turned, low, middle)
        astern = where(slide < p.J_syo0 * turned, c_5 * turned * turned, astern)
        share = p.pitch / p.diameter
        ahead = share * share * ((c_6 * slide + c_7 * turned) * slide + c_8 * turned * turned)
        acts = where(n < 0.0, astern, where((n > 0.0) & (slide < 0.0), ahead, 0.0 * ahead))
        return 0.5 * p.water_density * p.hull_length * p.hull_draft * acts

    @classmethod
    def acts_at(cls, x: Number, p: Any) -> Number:
        """Published moments are about the origin."""
        return 0.0 * x

    @classmethod
    def reach(cls, flow: Flow, p: Any) -> tuple[Span, ...]:
        return ()


class ReversedFoil(NamedTuple):
    """What a rudder needs behind a shaft that turns astern."""

    race_astern: Annotated[float, "1", "k_xR, share of the astern slipstream that meets the rudder"] = (
        0.0
    )
    pressure_astern: Annotated[float, "1", "C_pr, change of u_R^2 by the shaft astern, over u^2"] = 0.0


class FourQuadrantRudder(RudderInRace):
    """Rudder behind a propeller in four quadrants.

    Ahead the race is that of the MMG model for low speed, u_P + kappa (sqrt(u_P^2 + 8 K_T n^2 D^2 / pi)
    - u_P). Behind a shaft astern of a ship that goes ahead, u_R is by Kitagawa. Of a ship astern it is
    u, but behind a shaft ahead that thrusts. The flow across it is -gamma (v + l_R r).
    """

    name = "four_quadrant_rudder"
    changes = (
        *RudderInRace.changes,
        Change(
            "race_astern",
            ("race_astern", "pressure_astern"),
            "flow downstream of the shaft running astern",
        ),
    )
    Parameters = group_of("FourQuadrantFoil", [*variables(RaceFoil), *variables(ReversedFoil)])

    @classmethod
    def met(cls, flow: Flow, p: Any) -> tuple[Number, Number]:
        assert flow.race is not None
        inflow, _, diameter, added, n = flow.race
        u, eta = flow.hull_u, covered(diameter, p.span)
        raced = inflow + p.race * (sqrt(fmax(0.0, inflow * inflow + added)) - inflow)
        ahead = p.inflow * sqrt(eta * raced * raced + (1.0 - eta) * inflow * inflow)
        free = p.inflow * inflow
        sucked = free - p.race_astern * sqrt(abs(added))
        square = eta * sucked * abs(sucked) + (1.0 - eta) * free * free
        behind = signed_root(square + p.pressure_astern * u * u)
        along = where((u >= 0.0) | ((n > 0.0) & (added > 0.0)), where(n < 0.0, behind, ahead), u)
        across = flow.hull_v + p.inflow_lever * flow.r
        return along, -where(flow.v >= 0.0, p.gamma_minus, p.gamma_plus) * across

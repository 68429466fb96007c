"""Groups of signals that pass between components, each declared once."""

from typing import Annotated, NamedTuple


class Nothing(NamedTuple):
    """The inputs of a component that has none."""


class Measurement(NamedTuple):
    """Pose as the measurement system reports it, eta_m."""

    x_m: Annotated[float, "m", "measured north position"] = 0.0
    y_m: Annotated[float, "m", "measured east position"] = 0.0
    psi_m: Annotated[float, "rad", "measured heading, from north towards east"] = 0.0


class Force(NamedTuple):
    """A body-fixed force in surge and sway and a yaw moment, tau."""

    tau_X: Annotated[float, "N", "surge force, forward"] = 0.0
    tau_Y: Annotated[float, "N", "sway force, to starboard"] = 0.0
    tau_N: Annotated[float, "N.m", "yaw moment, bow to starboard"] = 0.0


class ForceInWind(NamedTuple):
    """The same, and the true wind: its speed, and from where it blows; NaN: not known."""

    tau_X: Annotated[float, "N", "surge force, forward"] = 0.0
    tau_Y: Annotated[float, "N", "sway force, to starboard"] = 0.0
    tau_N: Annotated[float, "N.m", "yaw moment, bow to starboard"] = 0.0
    wind_speed: Annotated[float, "m/s", "optional: speed of the true wind"] = 0.0
    wind_direction: Annotated[
        float, "rad", "optional: direction that the true wind blows from, from north towards east"
    ] = 0.0


class VelocityInCurrent(NamedTuple):
    """Body-fixed velocity over ground, nu, and that of the water along its axes (Fossen 2021, 8.3)."""

    u: Annotated[float, "m/s", "surge velocity, forward"] = 0.0
    v: Annotated[float, "m/s", "sway velocity, to starboard"] = 0.0
    r: Annotated[float, "rad/s", "yaw rate, bow to starboard"] = 0.0
    u_c: Annotated[float, "m/s", "velocity of the water, forward"] = 0.0
    v_c: Annotated[float, "m/s", "velocity of the water, to starboard"] = 0.0


class Estimate(NamedTuple):
    """What an observer knows: pose (heading continuous, not wrapped), nu and its derivative."""

    x_hat: Annotated[float, "m", "estimated north position"] = 0.0
    y_hat: Annotated[float, "m", "estimated east position"] = 0.0
    psi_hat: Annotated[float, "rad", "estimated heading, continuous over turns"] = 0.0
    u_hat: Annotated[float, "m/s", "estimated surge velocity"] = 0.0
    v_hat: Annotated[float, "m/s", "estimated sway velocity"] = 0.0
    r_hat: Annotated[float, "rad/s", "estimated yaw rate"] = 0.0
    u_dot_hat: Annotated[float, "m/s2", "estimated surge acceleration"] = 0.0
    v_dot_hat: Annotated[float, "m/s2", "estimated sway acceleration"] = 0.0
    r_dot_hat: Annotated[float, "rad/s2", "estimated yaw acceleration"] = 0.0
    frozen: Annotated[float, "1", "1 while the measurement is frozen or lost, else 0"] = 0.0


class Target(NamedTuple):
    """Where the ship should be, eta_t, with its first two derivatives in time."""

    x_t: Annotated[float, "m", "target north position"] = 0.0
    y_t: Annotated[float, "m", "target east position"] = 0.0
    psi_t: Annotated[float, "rad", "target heading in (-pi, pi]"] = 0.0
    x_t_dot: Annotated[float, "m/s", "target north velocity"] = 0.0
    y_t_dot: Annotated[float, "m/s", "target east velocity"] = 0.0
    psi_t_dot: Annotated[float, "rad/s", "target yaw rate"] = 0.0
    x_t_ddot: Annotated[float, "m/s2", "target north acceleration"] = 0.0
    y_t_ddot: Annotated[float, "m/s2", "target east acceleration"] = 0.0
    psi_t_ddot: Annotated[float, "rad/s2", "target yaw acceleration"] = 0.0

"""What a run may hold beside pose and commands: motion, wind, and outputs of actuators.

====================  ==============================================================================
``u v``               velocity over ground ahead and to starboard [m/s]
``x_dot y_dot``       velocity over ground to north and east [m/s]
``speed course``      over ground, as a satellite receiver says it [m/s, rad]
``r``                 yaw rate, positive to starboard [rad/s]
``u_water v_water``   velocity through the water ahead and to starboard [m/s]
``a_x a_y``           acceleration ahead and to starboard, u' - v r and v' + u r [m/s2]
``wind_speed``        of the true wind [m/s]
``wind_direction``    that it blows from, clockwise from north [rad]
``x_2 y_2 psi_2``     pose by a second receiver [m, m, rad]
``ACTUATOR.thrust``   force of an actuator as it is measured [N]
``ACTUATOR.torque``   on its shaft [N.m]
====================  ==============================================================================
"""

from collections.abc import Iterable

# Signal -> quantity.
BESIDE = {
    "u": "speed",
    "v": "speed",
    "x_dot": "speed",
    "y_dot": "speed",
    "speed": "speed",
    "course": "angle",
    "r": "rate",
    "u_water": "speed",
    "v_water": "speed",
    "a_x": "acceleration",
    "a_y": "acceleration",
    "wind_speed": "speed",
    "wind_direction": "angle",
    "x_2": "length",
    "y_2": "length",
    "psi_2": "angle",
}
OUTPUTS = {"thrust": "force", "torque": "moment"}  # of an actuator


def outputs(commands: Iterable[str]) -> dict[str, str]:
    """Outputs of a ship's actuators that may be measured -> quantity, for its ``ACTUATOR.COMMAND``."""
    actuators = dict.fromkeys(name.partition(".")[0] for name in commands if "." in name)
    return {f"{actuator}.{name}": q for actuator in actuators for name, q in OUTPUTS.items()}

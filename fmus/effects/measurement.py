"""Faults of the measurement chain that pass for physics."""

from typing import Annotated, Any

from ..declare import Range
from ..frames import rotate_to_earth
from .registry import Effect, add, effect

Pose = tuple[Any, Any, Any]
ABOARD = Range(-0.6, 0.6)  # the ship is 1.1 m long


@effect(
    "marker_offset",
    "measurement",
    "XYN",
    formula="p_m = p + R(psi) (dx, dy)",
    symbol="dx, dy",
    sign="positive: markers ahead and to starboard of where they are assumed",
    source="4.3.1, bias",
)
def marker_offset(
    pose: Pose,
    marker_offset_dx: Annotated[float, "m", "markers forward of the body origin", ABOARD] = 0.0,
    marker_offset_dy: Annotated[float, "m", "markers to starboard of the body origin", ABOARD] = 0.0,
) -> Pose:
    """The position is measured at another point of the ship."""
    x, y, psi = pose
    dx, dy = rotate_to_earth(psi, marker_offset_dx, marker_offset_dy)
    return x + dx, y + dy, psi


@effect(
    "heading_offset",
    "measurement",
    "XYN",
    formula="psi_m = psi + δ",
    symbol="δ",
    sign="positive: measured to starboard of the true heading",
    source="4.3.1, bias",
)
def heading_offset(
    pose: Pose,
    heading_offset: Annotated[float, "rad", "measured heading minus true heading"] = 0.0,
) -> Pose:
    """The heading is measured with an offset."""
    x, y, psi = pose
    return x, y, psi + heading_offset


add(
    Effect(
        id="clock_offset",
        kind="measurement",
        axis="XYN",
        description="the pose is older than its stamp: the fault 'delay' of a scenario",
        formula="(x, y, psi)_m(t) = (x, y, psi)(t - δ)",
        symbol="δ",
        sign="positive: the pose is older than its stamp",
        source="4.3.1",
        linear=False,
        parameters=(),
        function=None,
    )
)

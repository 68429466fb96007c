"""All checks of a run's channels, each on what the ones before have repaired."""

from fmus.scale import Scale

from ..files.reading import Run
from .further_channels import accelerations, receivers, through_water
from .motion import motion
from .sensor_finding import Examined
from .unit_faults import sway, units
from .wraps import wraps


def examine(run: Run, scale: Scale) -> Examined:
    """Cross-check channels that are redundant.

    Args:
        run: as it was read.
        scale: of the ship.

    Returns:
        The run as far as its own channels repair it, and what they say of each other.
    """
    found = Examined(run)
    # In the order in which one needs what others repair.
    for check in (wraps, units, sway, receivers, motion, accelerations, through_water):
        found = found.plus(check(found.run, scale))
    return found

"""Pose, velocity, acceleration of a measured run with their uncertainty, without a model of a ship."""

from .command_motion import idle
from .smoother import Smoothed, smooth

__all__ = ["Smoothed", "idle", "smooth"]

"""Pose, velocity, acceleration of a measured run with their uncertainty, without a model of a ship."""

from .command_motion import idle
from .smoother import Motion, Smoothed, smooth, without_commands

__all__ = ["Motion", "Smoothed", "idle", "smooth", "without_commands"]

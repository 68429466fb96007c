"""Pose, velocity, acceleration of a measured run with their uncertainty, without a model of a ship."""

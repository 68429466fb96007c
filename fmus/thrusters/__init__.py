"""Thrust allocation and the thrusters themselves."""

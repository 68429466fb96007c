"""Observers: pose measurements in, estimates of pose, velocity and acceleration out."""

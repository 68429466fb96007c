"""Detectors that watch a closed loop, one file for each FMU."""

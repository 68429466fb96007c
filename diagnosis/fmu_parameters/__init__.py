"""Calibration of an FMU's own parameters on measured runs, together with what its force inputs lack."""

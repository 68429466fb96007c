"""Observers replayed on the same measurements, simulated and of the basin (4.3, 6.3)."""

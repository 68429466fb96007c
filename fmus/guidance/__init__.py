"""Guidance: where the ship should be, how fast it should move and accelerate."""

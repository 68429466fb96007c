"""Diagnoses and comparisons kept as JSON, to see what a change of the code changes in its answers."""

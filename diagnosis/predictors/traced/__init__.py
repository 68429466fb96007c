"""The physics of predictions as a recorded program, and as components that run outside of Python."""

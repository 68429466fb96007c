"""Helpers of several tests: components in C, FMUs made on purpose, closed loops, made-up measured runs."""

__all__ = [
    "cases",
    "ccode",
    "command",
    "exchanged",
    "foreign",
    "lag",
    "loops",
    "measured",
    "opened",
    "plain",
    "project",
    "serial",
    "shared",
]

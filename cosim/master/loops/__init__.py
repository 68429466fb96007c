"""The step loops: in Python, and compiled; which one a run takes."""

__all__: list[str] = []

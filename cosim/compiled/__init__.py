"""What runs as machine code where it can: the step loop, from C in this folder."""

__all__: list[str] = []

"""What runs as machine code where it can: step loop and text of the log, from C in this folder."""

__all__: list[str] = []

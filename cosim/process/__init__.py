"""The process of a run: its state where another process reads it, and its scratch folders."""

__all__: list[str] = []

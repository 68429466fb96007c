"""The process that watches a run, for ``python -m cosim.run``."""

__all__: list[str] = []

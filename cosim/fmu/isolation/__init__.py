"""FMUs in processes of their own, which may be confined: the master's end, and theirs."""

__all__: list[str] = []

"""A page in which a scenario runs: one HTML file, without a server."""

__all__: list[str] = []

"""The command ``cybership``: one name for the commands of the project."""

__all__: list[str] = []

"""The command ``cybership``: one name for the commands of the project; and what all of them share."""

__all__: list[str] = []

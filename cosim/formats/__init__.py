"""Files of the SSP and OSP standards: parameter sets, variable groups, systems as scenarios."""

__all__: list[str] = []

"""Systems that come from other tools, and go to them: SSP archives, OSP directories, container FMUs."""

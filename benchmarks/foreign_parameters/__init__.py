"""Is a parameter off, or is physics missing? How often ``learn`` is right with foreign FMUs."""

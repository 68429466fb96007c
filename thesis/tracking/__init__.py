"""Chapter 5: what is kept of a run that follows a path, and the thesis' conclusions held against it."""

"""The residual of a model: how large it is, what it depends on, and whether it changes at a moment."""

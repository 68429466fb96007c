"""Evidence in, a verdict out: what is kept, how sure it is, what it is called."""

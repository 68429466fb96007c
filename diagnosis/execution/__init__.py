"""How work is done: in two processes, with progress, with files that appear together."""

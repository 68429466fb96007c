"""What runs as machine code where it can: the step loop and the text of the log, from C in this folder."""

"""What the columns of a measurement mean: names, units, signs, and the file next to it."""

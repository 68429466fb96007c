"""What a diagnosis says of files that do not hold what they seem to hold."""

"""Measurements of this project, each a script that anyone can run."""

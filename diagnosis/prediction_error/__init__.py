"""Fit to what is shown: predictions over some seconds, with a posterior and bands."""

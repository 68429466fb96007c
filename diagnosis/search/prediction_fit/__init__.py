"""The fit to predictions over some seconds, with a posterior and bands."""

"""Models that this project did not make: FMUs for co-simulation as predictors of measured runs."""

"""Controllers: estimate and target in, requested force out."""

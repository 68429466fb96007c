"""Chapter 7: models of the model error, by regression and system identification, back in the ship."""

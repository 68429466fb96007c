"""The plant: the hull of a ship and everything that acts on it."""

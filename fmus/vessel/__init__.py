"""The plant: the hull of CyberShip Enterprise 1 and everything that acts on it."""

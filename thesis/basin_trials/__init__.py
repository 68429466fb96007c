"""Chapter 6: the basin trials in simulation, and the lessons and observations held against them."""

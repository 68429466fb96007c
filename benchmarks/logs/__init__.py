"""Good runs resampled, filtered and rounded as logs come, and what the diagnosis makes of them."""

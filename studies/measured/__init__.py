"""The measured ship: each run left out in turn, targets, bollard pulls, tables."""

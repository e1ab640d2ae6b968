"""What is said of a run beside its scores: pairs of skills, models, stitches, the forecast."""

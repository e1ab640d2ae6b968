"""Episodes of a run, played again: step by step, and as films."""

"""What work costs: counted from settings, or as this store has seen it."""

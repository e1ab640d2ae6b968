"""Tables of a run: their rows, cells and gains, and how they are written."""

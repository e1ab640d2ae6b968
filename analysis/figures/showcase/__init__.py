"""The task that a run shows, as pictures."""

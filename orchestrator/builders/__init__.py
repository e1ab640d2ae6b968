"""How each kind of artifact is made, and whose code decides what is in it."""

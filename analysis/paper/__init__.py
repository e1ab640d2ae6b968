"""The numbers printed in the paper, what they imply, and whether a run agrees with them."""

"""What trained models are asked, and what stitches did: for reports; no score depends on it."""

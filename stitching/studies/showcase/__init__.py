"""Recorded episodes for figures; no score depends on them."""

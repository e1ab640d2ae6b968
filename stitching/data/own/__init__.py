"""People's own offline data, for any benchmark: docs/own-data.md says how they are to be."""

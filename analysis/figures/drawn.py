"""What a report knows of a figure."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Drawn:
    """A figure on disk: <name>.svg and <name>.png, and what it shows, in words.

    Where it could not be drawn `missing` says why, and there are no files.
    """

    name: str
    caption: str
    table: str  # id of the table it belongs to, "" if to the whole run
    missing: str = ""

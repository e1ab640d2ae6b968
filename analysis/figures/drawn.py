"""What a report knows of a figure."""

from dataclasses import dataclass

DRAWING = ("svg", "png")
PHOTOGRAPH = ("png",)  # as vectors, pictures would be the same pixels and half as many bytes again


@dataclass(frozen=True)
class Drawn:
    """A figure on disk, <name>.<format> for each format, and what it shows, in words.

    Where it could not be drawn `missing` says why, and there are no files.
    """

    name: str
    caption: str
    table: str  # id of the table it belongs to, "" if to the whole run
    missing: str = ""
    formats: tuple[str, ...] = DRAWING

    @property
    def files(self) -> list[str]:
        """The first is the one to show on a page."""
        return [] if self.missing else [f"{self.name}.{each}" for each in self.formats]

"""Figures inside the page, legible on a telephone too."""

import base64
import re
from html import escape
from pathlib import Path

from PIL import Image

from analysis.figures.drawn import Drawn
from analysis.figures.style import OPTIONS, SMALLEST

LEGIBLE = 9  # CSS pixels that the smallest letters are high, at least
PIXELS_AN_INCH = 96  # of CSS
POINTS_AN_INCH = 72


def figure_html(figure: Drawn, folder: Path) -> str:
    """The figure with its caption, or why there is none. Narrower screens scroll it sideways."""
    if figure.missing:
        return f'<p class="note">{escape(figure.missing)}</p>'
    # As an image of its own, an SVG's element ids cannot clash with another's.
    file = folder / figure.files[0]
    data = base64.b64encode(file.read_bytes()).decode("ascii")
    kind = "svg+xml" if file.suffix == ".svg" else "png"
    caption = escape(figure.caption)
    width, height = _inches(file)
    natural = width * PIXELS_AN_INCH
    least = natural * LEGIBLE / (SMALLEST * PIXELS_AN_INCH / POINTS_AN_INCH)
    return (
        f'<figure><div class="scroll" tabindex="0"><img src="data:image/{kind};base64,{data}" '
        f'width="{natural:.0f}" height="{height * PIXELS_AN_INCH:.0f}" '
        f'style="--least: {least:.0f}px" alt="{caption}"></div>'
        f"<figcaption>{caption}</figcaption></figure>"
    )


def named_figures(names: tuple[str, ...], drawn: list[Drawn], folder: Path) -> str:
    """Those of these names, one below the other."""
    return "".join(figure_html(figure, folder) for figure in drawn if figure.name in names)


def _inches(file: Path) -> tuple[float, float]:
    """Width and height of a figure as it was drawn."""
    if file.suffix == ".svg":
        head = file.read_text(encoding="utf-8")[:2000]
        width, height = (float(re.findall(rf'{side}="([\d.]+)pt"', head)[0]) for side in SIDES)
        return width / POINTS_AN_INCH, height / POINTS_AN_INCH
    with Image.open(file) as image:
        width, height = image.size
    return width / OPTIONS["png"]["dpi"], height / OPTIONS["png"]["dpi"]


SIDES = ("width", "height")

"""What all figures share: colours, fonts, and files whose bytes depend on the content alone."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import matplotlib as mpl
from matplotlib.figure import Figure

# Okabe and Ito's palette, told apart by colour-blind readers; black and yellow left out.
COLOURS = ["#0072B2", "#E69F00", "#009E73", "#D55E00", "#CC79A7", "#56B4E9", "#7F7F7F"]
MARKERS = ["o", "s", "^", "D", "v", "P", "X", "<", ">", "*"]
INK, FAINT = "#222222", "#D0D0D0"

SETTINGS: dict[Any, Any] = {
    "svg.hashsalt": "skillstitch",  # element ids in SVG files are random otherwise
    "svg.fonttype": "path",  # letters look the same on machines with other fonts
    "font.family": "DejaVu Sans",
    "font.size": 9,
    "axes.titlesize": 10,
    "axes.edgecolor": FAINT,
    "axes.labelcolor": INK,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "text.color": INK,
    "xtick.color": INK,
    "ytick.color": INK,
    "legend.frameon": False,
    "figure.facecolor": "white",
}


@contextmanager
def house_style() -> Iterator[None]:
    """Inside, matplotlib draws as configured here, whatever the user's own settings are."""
    with mpl.rc_context():
        mpl.rcdefaults()
        mpl.rcParams.update(SETTINGS)
        yield


def new_figure(width: float, height: float) -> Figure:
    """A figure in inches that belongs to no window and no global list of figures."""
    return Figure(figsize=(width, height), layout="constrained")


def save(figure: Figure, folder: Path, name: str, image_dpi: int = 100) -> None:
    """Writes <name>.svg and <name>.png; the same figure gives the same bytes.

    `image_dpi` is the resolution of pictures inside the SVG.
    """
    folder.mkdir(parents=True, exist_ok=True)
    metadata = {"Date": None, "Creator": None}
    figure.savefig(folder / f"{name}.svg", dpi=image_dpi, metadata=metadata)
    figure.savefig(folder / f"{name}.png", dpi=144, metadata={"Software": None})

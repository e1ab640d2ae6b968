"""The forecast of pairs of skills, beside what was played."""

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from analysis.figures.pairs import blank_key, draw_matrix, explain, two_panels
from analysis.figures.style import INK
from analysis.schema import RunSpec


def draw_forecast(table: pd.DataFrame, spec: RunSpec) -> Figure:
    """Left the forecast, right each played pair's rate against its forecast.

    table: `analysis.studies.forecast.forecast_table`.
    """
    figure, (left, right) = two_panels(spec)
    forecast = table.set_index(["first", "second"])["forecast"].to_dict()
    matrix = np.array(
        [[forecast.get((first, second), np.nan) for second in spec.skills] for first in spec.skills]
    )
    draw_matrix(left, matrix, spec)
    if np.isnan(matrix).any():
        explain(figure, [blank_key("no forecast")])
    left.set_ylabel("first skill, accomplished")
    left.set_title("Forecast")
    _calibration(right, table[table["trials"] > 0])
    return figure


def _calibration(axes: Axes, played: pd.DataFrame) -> None:
    axes.plot([0, 1], [0, 1], ls="--", lw=1, color=INK)
    axes.scatter(
        played["forecast"],
        played["rate"],
        s=6 + 60 * played["trials"] / played["trials"].max(),
        alpha=0.6,
    )
    axes.set(xlim=(-0.03, 1.03), ylim=(-0.03, 1.03), aspect="equal")
    axes.set_xlabel("forecast")
    axes.set_ylabel("played, without a stitch")
    axes.set_title("Forecast and played")

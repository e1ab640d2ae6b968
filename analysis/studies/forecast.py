"""The forecast of second skills (stitching.studies.forecast) beside what was played."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pandas as pd

from analysis.run import Run
from analysis.studies.pairs import BASELINE, pair_counts, second_skills

COLUMNS = [
    "first", "second", "distance", "forecast", "successes", "trials", "rate",
]  # fmt: skip

FORECAST_NOTE = (
    "No pair that was played goes into the forecast: a second skill succeeds as often as from its "
    "own held-out starts, times the mean of exp(−d) over the states in which held-out "
    "demonstrations of the first skill succeed: d is the distance to the nearest held-out "
    "start of the second, 1 where the robot's pose and all objects' positions differ by a "
    "standard deviation each. "
    "Demonstrations of the first skill may have moved other objects before; where a pair is "
    "played, nothing came before it."
)


def forecast_table(run: Run) -> pd.DataFrame:
    """COLUMNS, one row a pair; rate: of the second skill where the first succeeded, No-Stitch.

    Over all seeds; NaN where the first never did. The forecast is from the first seed's models.
    Empty for a run that was merged from several, or without a forecast.
    """
    foretold = [] if run.spec.parts else run.diagnosis.get("forecast", [])
    counts = pair_counts(second_skills(run.segments, run.spec)) if foretold else {}
    rows = []
    for pair in foretold:
        wins, trials = counts.get((pair["first"], pair["second"], BASELINE), (0, 0))
        rate = wins / trials if trials else np.nan
        rows.append(
            [pair["first"], pair["second"], pair["distance"], pair["success"], wins, trials, rate]
        )
    return pd.DataFrame(rows, columns=COLUMNS)


@dataclass(frozen=True)
class Agreement:
    """How a forecast did, over the pairs that were played."""

    pairs: int
    trials: int
    rank_correlation: float  # Spearman's, of forecasts and rates; each pair counts once
    brier: float  # mean over trials of (forecast − outcome)², outcome 1 or 0
    brier_of_mean: float  # of one number for all pairs: the mean outcome, known afterwards
    brier_of_rates: float  # of each pair's own rate, known afterwards: no forecast has less


def agreement(table: pd.DataFrame) -> Agreement | None:
    """None where fewer than three pairs were played, or all rates or forecasts are alike."""
    played = table[table["trials"] > 0]
    if len(played) < 3 or played["rate"].nunique() < 2 or played["forecast"].nunique() < 2:
        return None
    mean = float(played["successes"].sum() / played["trials"].sum())
    return Agreement(
        len(played),
        int(played["trials"].sum()),
        float(played["forecast"].corr(played["rate"], method="spearman")),
        _brier(played, played["forecast"]),
        _brier(played, pd.Series(mean, index=played.index)),
        _brier(played, played["rate"]),
    )


def _brier(played: pd.DataFrame, chance: pd.Series[float]) -> float:
    losses = played["trials"] - played["successes"]
    squares = played["successes"] * (1 - chance) ** 2 + losses * chance**2
    return float(squares.sum() / played["trials"].sum())


def agreement_text(found: Agreement) -> str:
    """Two sentences, for the page and for people."""
    return (
        f"Over the {found.pairs} pairs that were played ({found.trials:,} trials) the rank "
        f"correlation of forecast and rate is {found.rank_correlation:.2f}. The Brier score is "
        f"{found.brier:.3f}; one number for all pairs, their mean rate, would have "
        f"{found.brier_of_mean:.3f}, and each pair's own rate {found.brier_of_rates:.3f}, both of "
        "which are known only afterwards."
    )

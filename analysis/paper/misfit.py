"""How far a run is from the paper where nothing is planned: its skills, and its scores without us.

Data are chosen by this number, so it leaves MB-Stitch out.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import pandas as pd

from analysis.paper.implied import FIRST, MEAN, SECOND
from analysis.paper.numbers import paper_scores

PROFILED = "no-stitch"
"""The method whose first and second skills are compared: they are the skills', unstitched."""

_TABLE = "2"


@dataclass(frozen=True)
class Misfit:
    """Three distances, each a mean of absolute differences of rates or scores; 0 fits."""

    first: float  # of PROFILED's first skills from what Table 8 implies for them
    second: float  # likewise of its second skills
    cells: float  # of the methods' scores from Table 2's

    @property
    def total(self) -> float:
        """(first + second) / 2 + cells: what the fourteen skills are off by, and what scores are.

        Skills weigh alike. Scores are added because they are no more than skills in the mean: a
        profile whose rates all lie at the same end of their ranges is off in the cells.
        """
        return (self.first + self.second) / 2 + self.cells


def misfit(profile: pd.DataFrame, scores: Mapping[tuple[str, int], float]) -> Misfit:
    """Compare a profile and scores with the paper's.

    profile: `analysis.paper.profile.COLUMNS`; only PROFILED's rows count.
    scores: (method, skills of a task) → mean over all such tasks, as in a cell of Table 2.

    A skill is off by as much as its rate lies outside the implied range. ValueError where there is
    nothing to compare with: a run that lacks pairs of skills has no ranges.
    """
    off = outside(profile[(profile["method"] == PROFILED) & (profile["skill"] != MEAN)])
    kinds = [off[off["kind"] == kind]["outside"] for kind in (FIRST, SECOND)]
    if any(kind.empty or kind.isna().any() for kind in kinds):
        raise ValueError(f"the paper implies nothing for these skills of {PROFILED}")
    printed = paper_scores(_TABLE)
    differences = [
        abs(score - printed[f"{length} skills", method][0])
        for (method, length), score in scores.items()
    ]
    first, second = (float(kind.mean()) for kind in kinds)
    return Misfit(first, second, sum(differences) / len(differences))


def outside(profile: pd.DataFrame) -> pd.DataFrame:
    """The profile with a column: how far its rate lies outside the implied range (0 inside)."""
    below = profile["implied_low"] - profile["rate"]
    above = profile["rate"] - profile["implied_high"]
    return profile.assign(outside=pd.concat([below, above], axis=1).max(axis=1).clip(lower=0))

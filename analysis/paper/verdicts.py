"""Does a run agree with the paper? Cell by cell, and claim by claim."""

from collections.abc import Hashable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from analysis.paper.numbers import HALF_DIGIT, accomplished_skills, paper_table
from analysis.results import SCALES
from analysis.tables.table import Table

NEAR = 0.05
"""Scores this close agree whatever the interval: environments, data and seeds are not the same."""

SAME_SKILLS = 0.1
"""Numbers of accomplished skills this close count as constant over task lengths."""

SAME_ERROR = 0.001
"""A printed ± matches ours up to one unit of its last digit."""

AGREES, HIGHER, LOWER, NO_DATA, NOT_PRINTED = "agrees", "higher", "lower", "no data", "not in paper"
JUDGEMENTS = (AGREES, HIGHER, LOWER)
NOT_JUDGED = "not judged"
HOLDS, UNDECIDED, FAILS = "holds", "undecided", "fails"

EXPLANATION = (
    f"“{AGREES}”: the paper's score lies in our 95 % interval or within {NEAR} of our score; "
    f"otherwise “{HIGHER}” or “{LOWER}” says where ours is. A claim “{HOLDS}” if its 95 % "
    f"interval lies wholly on its side of zero, “{FAILS}” if wholly on the other, and is "
    f"“{UNDECIDED}” if the interval contains zero. Only the claim of a constant number of "
    f"accomplished skills is judged without an interval: it “{HOLDS}” if our numbers lie within "
    f"{SAME_SKILLS} of each other at all lengths, and else “{FAILS}”."
)
SMOKE = SCALES[0]
SMOKE_EXPLANATION = (
    "The smoke scale shows that everything runs. Its models are hardly trained and its episodes "
    "few, so it is not judged by the paper's numbers."
)
ONE_SEED = "for these models"
ONE_SEED_EXPLANATION = (
    f"A verdict from one seed is “{ONE_SEED}” only, cells' verdicts included: whether it is so "
    "for others, trained in the same way, takes more seeds."
)


@dataclass(frozen=True)
class Claim:
    """Something the paper's table says, and whether the run says it too."""

    text: str
    verdict: str  # HOLDS, UNDECIDED, FAILS or NO_DATA
    detail: str
    seeds: int = 0

    @property
    def judgement(self) -> str:
        """The verdict as it may be said: of one seed's models where there are no others."""
        of_models = self.seeds == 1 and self.verdict in (HOLDS, FAILS)
        return f"{self.verdict} {ONE_SEED}" if of_models else self.verdict


def explanation(table: Table) -> str:
    """How the table's verdicts are to be read."""
    if table.spec.scale == SMOKE:
        return SMOKE_EXPLANATION
    return " ".join([EXPLANATION, *([ONE_SEED_EXPLANATION] if table.fewest_seeds == 1 else [])])


def cell_verdict(score: float, low: float, high: float, paper_score: float) -> str:
    """How our score stands to the paper's."""
    if np.isnan(score):
        return NO_DATA
    if np.isnan(paper_score):
        return NOT_PRINTED
    # The comparison is one of decimals: 0.05 apart must not depend on binary rounding.
    if low <= paper_score <= high or abs(score - paper_score) <= NEAR + 1e-9:
        return AGREES
    return HIGHER if score > paper_score else LOWER


def cell_verdicts(table: Table) -> list[str]:
    """One verdict for each line of the table's scores."""
    columns = table.scores[["score", "ci_low", "ci_high", "paper_score"]].to_numpy(dtype=float)
    verdicts = [cell_verdict(*cell) for cell in columns]
    if table.spec.scale == SMOKE:
        return [NOT_JUDGED if verdict in JUDGEMENTS else verdict for verdict in verdicts]
    return verdicts


def claims(table: Table) -> list[Claim]:
    """All claims of the paper's table that the run can speak to: none at smoke scale."""
    if table.spec.scale == SMOKE:
        return []
    return [*_orders(table), *_leads(table), *_constant_skills(table)]


def _orders(table: Table) -> list[Claim]:
    """Table 4: who leads the tasks that keep the demonstrations' order, and who the others."""
    return [
        _lead(
            table,
            lead,
            f"{lead['row']} → {table.labels[lead['method']]} leads",
            "on average over these tasks",
        )
        for lead in table.orders.to_dict("records")
    ]


def _leads(table: Table) -> list[Claim]:
    """The paper's best method of each row is the best here, too."""
    return [
        _lead(
            table,
            lead,
            f"{table.labels[lead['method']]} leads “{lead['row']}”",
            "the best here of the paper's others",
        )
        for lead in table.leads.to_dict("records")
    ]


def _lead(table: Table, lead: Mapping[Hashable, Any], text: str, about: str) -> Claim:
    """A line of GAIN_COLUMNS as a claim that the method is ahead."""
    if lead["pairs"] == 0:
        return Claim(text, NO_DATA, "no episode played by both", lead["seeds"])
    detail = (
        f"{lead['gain']:+.3f} [{lead['ci_low']:+.3f}, {lead['ci_high']:+.3f}] over "
        f"{table.labels[lead['baseline']]}, {about} "
        f"({_seeds(lead['seeds'])}, {lead['pairs']:,} paired episodes)"
    )
    return Claim(text, _side(lead["ci_low"], lead["ci_high"]), detail, lead["seeds"])


def _side(low: float, high: float) -> str:
    if low > 0:
        return HOLDS
    return FAILS if high < 0 else UNDECIDED


def _seeds(count: int) -> str:
    return f"{count} seed" if count == 1 else f"{count} seeds"


def _constant_skills(table: Table) -> list[Claim]:
    """No-Stitch accomplishes as many skills however long the task: claimed where the paper's does.

    Table 1: 0.584·2 = 0.389·3 = 0.292·4 up to rounding, since the third skill is never reached.
    """
    method = "no-stitch"
    if table.entry.rows != "length" or paper_table(table.entry.paper).empty:
        return []
    printed = accomplished_skills(table.entry.paper, method)
    rounding = 2 * HALF_DIGIT * max(int(row.split()[0]) for row in printed.index)
    if np.ptp(printed) > rounding:
        return []
    cells = table.scores.query("method == @method").dropna(subset="paper_score").set_index("row")
    ours = cells["score"] * [int(row.split()[0]) for row in cells.index]
    text = f"{table.labels[method]} accomplishes the same number of skills at every length"
    if cells.empty:
        return []
    if ours.isna().any() or len(ours) < 2:
        return [Claim(text, NO_DATA, "needs at least two of the paper's lengths")]
    detail = ", ".join(f"{skills:.3f} in {row}" for row, skills in ours.items())
    constant = np.ptp(ours) <= SAME_SKILLS
    return [
        Claim(
            text,
            HOLDS if constant else FAILS,
            f"{detail}; spread {np.ptp(ours):.3f}, at most {SAME_SKILLS} counts as constant "
            f"(paper: {printed.min():.3f} to {printed.max():.3f})",
            int(cells["seeds"].min()),
        )
    ]


def error_reading(table: Table) -> str:
    """Which reading of the paper's ± our own spread over seeds matches better, in a sentence."""
    if table.spec.scale == SMOKE:
        return ""
    cells = table.scores.dropna(subset=["score", "paper_error"])
    if cells.empty:
        return ""
    if (cells["seeds"] < 2).all():
        return "One seed: there is no spread over seeds to compare the paper's ± with."
    variance, std = (
        int((abs(cells[kind].round(3) - cells["paper_error"]) <= SAME_ERROR + 1e-9).sum())
        for kind in ("variance", "std")
    )
    better = "the variance" if variance > std else "the standard deviation"
    verdict = "both equally well" if variance == std else f"{better} better"
    return (
        f"The paper's ± is within {SAME_ERROR} of our variance over seeds in {variance} of "
        f"{len(cells)} cells and of our standard deviation in {std}: it matches {verdict}. "
        "(The paper calls it variance. Both are taken with ddof = 0.)"
    )

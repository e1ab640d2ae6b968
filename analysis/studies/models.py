"""Whether the models behind the scores are right: policies, values and dynamics, as numbers."""

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
import pandas as pd
from scipy.stats import rankdata

from analysis.run import Run
from analysis.statistics import wilson
from analysis.studies.pairs import BASELINE, second_skills
from analysis.tables.skills import single_skill_rates

COLUMNS = ["measure", "of", "value", "ci_low", "ci_high", "successes", "trials"]


def auc(values: np.ndarray, success: np.ndarray, seeds: np.ndarray) -> float:
    """P(a success began at a higher value than a failure of the same seed), ties counted half.

    Mann and Whitney's statistic; (N,) each. Another seed's values are another network's, so they
    are not compared. NaN where no seed has both successes and failures.
    """
    higher, compared = 0.0, 0
    for seed in np.unique(seeds):
        won = success[seeds == seed].astype(bool)
        successes, failures = int(won.sum()), int((~won).sum())
        ranks = rankdata(values[seeds == seed])
        higher += ranks[won].sum() - successes * (successes + 1) / 2
        compared += successes * failures
    return higher / compared if compared else np.nan


def model_table(run: Run) -> pd.DataFrame:
    """COLUMNS, one row a measure and skill, group of dimensions, or "all"; NaN where unknown.

    "successes" and "trials" are counts behind the value; of a rank correlation of values trials
    are demonstrations, of one of disagreement states.
    """
    records = [*_of_policies(run), *_of_values(run), *_of_dynamics(run.diagnosis)]
    table = pd.DataFrame(records, columns=COLUMNS)
    return table.astype({"successes": "Int64", "trials": "Int64"})


Row = tuple[str, str, float, float, float, float, float]


def _of_policies(run: Run) -> Iterator[Row]:
    """From where own demonstrations begin, from the start pose, and after other skills."""
    for skill, study in _by_skill(run, "competence"):
        yield _rate("competence", skill, study["successes"], study["trials"])
    first = single_skill_rates(run.segments, run.spec)
    for rate in first[first["method"] == ""].to_dict("records"):
        yield _rate("from start pose", rate["skill"], rate["successes"], rate["trials"])
    for skill, part in _after_others(run):
        yield _rate("after other skills", skill, int(part["success"].sum()), len(part))


def _of_values(run: Run) -> Iterator[Row]:
    for skill, study in _by_skill(run, "values"):
        demonstrations = study["demonstrations"]
        yield _plain("value rank correlation", skill, study["rank_correlation"], demonstrations)
    for skill, part in _after_others(run):
        success = part["success"].to_numpy()
        area = auc(part["value_start"].to_numpy(), success, part["seed"].to_numpy())
        yield "auc", skill, area, np.nan, np.nan, int(success.sum()), len(part)


def _of_dynamics(diagnosis: Mapping[str, Any]) -> Iterator[Row]:
    for steps, study in diagnosis.get("predictions", {}).items():
        for group, error in study["groups"].items():
            for kind in ("relative", "rmse"):
                yield _plain(f"{kind} error after {steps}", group, error[kind], study["states"])
        correlation = study["disagreement_rank_correlation"]
        yield _plain(
            f"disagreement rank correlation after {steps}", "all", correlation, study["states"]
        )


def _by_skill(run: Run, study: str) -> Iterator[tuple[str, Any]]:
    known = run.diagnosis.get(study, {})
    return ((skill, known[skill]) for skill in run.spec.skills if skill in known)


def _after_others(run: Run) -> Iterator[tuple[str, pd.DataFrame]]:
    """Each skill with its plays after another one, nothing in between."""
    seconds = second_skills(run.segments, run.spec)
    plain = seconds[seconds["method"] == BASELINE]
    parts = ((skill, plain[plain["second"] == skill]) for skill in run.spec.skills)
    return ((skill, part) for skill, part in parts if not part.empty)


def _rate(measure: str, of: str, successes: int, trials: int) -> Row:
    low, high = wilson(np.array(successes), np.array(trials))
    rate = successes / trials if trials else np.nan
    return measure, of, rate, float(low), float(high), successes, trials


def _plain(measure: str, of: str, value: float, trials: int) -> Row:
    return measure, of, value, np.nan, np.nan, np.nan, trials

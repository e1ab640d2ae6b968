"""Smaller views of a run beside its tables: single skills, and every permutation."""

import pandas as pd

from analysis.schema import RunSpec
from analysis.statistics import wilson


def single_skill_rates(segments: pd.DataFrame, spec: RunSpec) -> pd.DataFrame:
    """How often each skill succeeds from the start of an episode, over all seeds.

    Columns skill, method ("" for those that share their first skills), successes, trials, rate,
    low, high; the interval is Wilson's, which takes episodes as independent and knows nothing of
    seeds.
    """
    first = segments[segments["depth"] == 1]
    counts = first.groupby(["method", "prefix"])["success"].agg(successes="sum", trials="count")
    rates = counts.reset_index().rename(columns={"prefix": "skill"})
    order = {skill: place for place, skill in enumerate(spec.skills)}
    rates = rates.sort_values(["method", "skill"], key=lambda c: c.map(order).fillna(0))
    rates["rate"] = rates["successes"] / rates["trials"]
    rates["low"], rates["high"] = wilson(rates["successes"].to_numpy(), rates["trials"].to_numpy())
    columns = ["skill", "method", "successes", "trials", "rate", "low", "high"]
    return rates[columns].reset_index(drop=True)


def permutation_scores(episodes: pd.DataFrame, spec: RunSpec) -> pd.DataFrame:
    """One row a (task, method), in the spec's order.

    Columns task, length, method, score, complete (share of episodes with every skill
    accomplished), steps (mean), episodes, seeds.
    """
    complete = episodes.assign(complete=episodes["accomplished"] == episodes["length"])
    scores = complete.groupby(["method", "task"], sort=False).agg(
        length=("length", "first"),
        score=("score", "mean"),
        complete=("complete", "mean"),
        steps=("steps", "mean"),
        episodes=("score", "size"),
        seeds=("seed", "nunique"),
    )
    columns = ["task", "length", "method", "score", "complete", "steps", "episodes", "seeds"]
    return scores.reset_index()[columns]

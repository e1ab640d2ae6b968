"""The metrics of a view: what the report says, each seed's own scores, learning curves."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from analysis.schema import VARIANT
from orchestrator.tracking.names import metric_name

if TYPE_CHECKING:
    import pandas as pd

    from analysis.schema import RunSpec, TableEntry

Curves = dict[str, list[tuple[int, float]]]


def reported(report: Path, table: str) -> dict[str, float]:
    """Scores and gains as the report gives them; nothing before there is a report."""
    import pandas as pd

    scores, gains = report / f"{table}.csv", report / f"{table}-gains.csv"
    if not (scores.is_file() and gains.is_file()):
        return {}
    cells = {
        f"{table}/{cell['row']}/{cell['method']}/{column}": cell[column]
        for cell in pd.read_csv(scores).to_dict("records")
        for column in ("score", "ci_low", "ci_high", "episodes")
    }
    return cells | {
        f"{table}/{duel['row']}/{duel['method']} over {duel['baseline']}/{column}": duel[column]
        for duel in pd.read_csv(gains).to_dict("records")
        for column in ("gain", "ci_low", "ci_high")
    }


def seed_scores(episodes: pd.DataFrame, spec: RunSpec, entry: TableEntry) -> dict[str, float]:
    """Scores of one seed by the table's rows, every task weighing the same, as a report has them.

    Intervals cover other episodes of this seed's models.
    """
    from analysis.statistics import arrange, estimate, generator
    from analysis.tables.rows import place_tasks

    metrics: dict[str, float] = {}
    places = place_tasks(spec, entry)[["task", "row"]]
    for row, played in episodes.merge(places, on="task").groupby("row"):
        cell = estimate(arrange(played, "score"), generator("tracking", entry.id, str(row)))
        metrics |= {
            f"{entry.id}/{row}/score": cell.mean,
            f"{entry.id}/{row}/ci_low": cell.low,
            f"{entry.id}/{row}/ci_high": cell.high,
            f"{entry.id}/{row}/episodes": float(cell.episodes),
        }
    return metrics


def mean_score(episodes: pd.DataFrame) -> dict[str, float]:
    """One number by which any two runs can be sorted: the mean over all tasks, of every length."""
    by_task = episodes.groupby("task")["score"].mean()
    return {"score": by_task.mean()} if len(by_task) else {}


def learning_curves(
    method: str, kinds: Collection[str] | None, seed: int, training: list[dict[str, Any]]
) -> Curves:
    """Learning curves of the models, by kind, that a method is played with under this seed.

    Of all kinds where these are not known, as of runs of earlier versions.
    """
    variant = method.partition(VARIANT)[2]
    used = [
        entry
        for entry in training
        if entry["seed"] == seed
        and (kinds is None or entry["kind"] in kinds)
        and (not variant or entry.get("part") == variant)
    ]
    several = {e["kind"] for e in used if sum(e["kind"] == other["kind"] for other in used) > 1}
    curves: Curves = {}
    for entry in used:
        kind = entry["kind"]
        head = f"{kind} {entry['key'][:8]}" if kind in several else kind
        for name, points in entry["curves"].items():
            kept = [(step, value) for step, value in points if math.isfinite(value)]
            curves[metric_name(f"{head}/{name}")] = kept
    return curves


def finite(*parts: Mapping[str, Any]) -> dict[str, float]:
    """Metrics under names that MLflow takes; cells without an episode (NaN) have none."""
    return {
        metric_name(name): float(value)
        for part in parts
        for name, value in part.items()
        if not isinstance(value, str | list | None) and math.isfinite(value)
    }

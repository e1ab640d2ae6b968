"""A run directory's readable files, written from the ledger and the store."""

from __future__ import annotations

import numpy as np
import pandas as pd

from analysis.schema import DATASETS, EPISODE_COLUMNS, QUARANTINE, SEGMENTS, SEPARATOR, TRAINING
from orchestrator.spec.structure import Plain
from orchestrator.storage.datasets import datasets
from orchestrator.storage.ledger import Ledger
from orchestrator.storage.rundir import RunDirectory
from orchestrator.storage.store import Store
from orchestrator.work.jobs import ATTEMPTS
from orchestrator.work.plan import Node, Plan


def segments_frame(plan: Plan, ledger: Ledger) -> pd.DataFrame:
    """One row per segment, in the plan's order, whoever played it and when."""
    places = {task.key: node for (node, _), task in plan.tasks.items()}
    nodes: list[Node] = []  # of each row
    columns = {name: [np.empty(0, kind)] for name, kind in EPISODE_COLUMNS.items()}
    for key, outcome in ledger.outcomes(places):
        nodes += [places[key]] * len(outcome.arrays["episode"])
        for name, parts in columns.items():
            parts.append(outcome.arrays[name])
    frame = pd.DataFrame(
        {
            "seed": np.array([node.seed for node in nodes], dtype=np.int64),
            "method": [node.method for node in nodes],
            "prefix": [SEPARATOR.join(node.prefix) for node in nodes],
            "depth": np.array([len(node.prefix) for node in nodes], dtype=np.int64),
        }
        | {name: np.concatenate(parts) for name, parts in columns.items()}
    )
    # Where nothing can stitch, values before and after a stitch are of no use.
    frame.loc[frame["method"] == "", ["value_start", "value_end"]] = np.float32(np.nan)
    return frame


def quarantine(plan: Plan, ledger: Ledger) -> list[Plain]:
    """Blocks that were given up, each with its last error."""
    finished, failures = ledger.finished(), ledger.failures()
    return [
        {
            "method": node.method,
            "seed": node.seed,
            "prefix": SEPARATOR.join(node.prefix),
            "episodes": list(range(*task.episodes)),
            "error": failures[task.key][1],
        }
        for (node, _), task in plan.tasks.items()
        if task.key not in finished and failures.get(task.key, (0, ""))[0] >= ATTEMPTS
    ]


def learning_curves(plan: Plan, store: Store) -> list[Plain]:
    """Curves of every trained artifact of the plan."""
    curves = []
    for key, recipe in plan.recipes.items():
        if key not in plan.needed:
            continue
        info = store.read(recipe.kind, key).info
        if "curves" in info:
            curves.append(
                {
                    "kind": recipe.kind,
                    "seed": recipe.params["seed"],
                    "name": f"{recipe.kind} seed {recipe.params['seed']}",
                    "key": key,
                    "curves": info["curves"],
                }
            )
    return curves


def write_readable(plan: Plan, store: Store, ledger: Ledger, directory: RunDirectory) -> Plain:
    """Write every readable file but the report; returns the counts for the provenance."""
    segments = segments_frame(plan, ledger)
    segments.to_parquet(directory.path / SEGMENTS, index=False)
    directory.write_json(QUARANTINE, quarantine(plan, ledger))
    directory.write_json(TRAINING, learning_curves(plan, store))
    directory.write_json(DATASETS, datasets(plan, store))
    for name, key in plan.illustrations.items():
        kind = plan.recipes[key].kind
        if (kind, key) in store:
            directory.write_json(f"{name}.json", store.read(kind, key).info)
    return {
        "segments played": len(segments),
        "environment steps": int(segments["steps"].sum()),
    }

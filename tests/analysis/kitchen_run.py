"""A synthetic Kitchen run directory: four skills, two methods, one order in the data."""

from collections.abc import Callable
from itertools import pairwise, permutations
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

SKILLS = ["microwave", "kettle", "light switch", "hinge cabinet"]
ORDERS = [["microwave", "kettle", "light switch"], ["kettle", "hinge cabinet"]]
METHODS = {"no-stitch": "No-Stitch", "mb-stitch": "MB-Stitch"}
EPISODES = 4


def kitchen_spec() -> dict[str, Any]:
    return {
        "name": "table2",
        "title": "Average scores of skill stitching on Kitchen",
        "benchmark": "kitchen",
        "scale": "smoke",
        "skills": SKILLS,
        "methods": [{"name": name, "label": label} for name, label in METHODS.items()],
        "seeds": [0, 1],
        "episodes": EPISODES,
        "tasks": [">".join(pair) for pair in permutations(SKILLS, 2)],
        "step_limits": {"2": 250},
        "tables": [{"id": "table2", "paper": "2", "rows": "length", "title": "Kitchen"}],
    }


def kitchen_segments() -> pd.DataFrame:
    """Without a stitch only pairs of the data succeed, in the first half of the episodes."""
    rng = np.random.default_rng(0)
    shown = {pair for order in ORDERS for pair in pairwise(order)}
    rows = []
    for seed in (0, 1):
        for episode in range(EPISODES):
            for first in SKILLS:
                rows.append((seed, "", first, 1, episode, True, 0, 60, 60, np.nan))
            for pair in permutations(SKILLS, 2):
                early = episode < EPISODES / 2
                plain = pair in shown and early
                for method, success in {"no-stitch": plain, "mb-stitch": plain or early}.items():
                    value = float(success) + rng.random()
                    rows.append(
                        (seed, method, ">".join(pair), 2, episode, success, 0, 60, 120, value)
                    )
    columns = [
        "seed", "method", "prefix", "depth", "episode", "success", "stitch_steps", "steps",
        "end_step", "value_start",
    ]  # fmt: skip
    return pd.DataFrame(rows, columns=columns)


def kitchen_episode(method: str, stitched: bool) -> dict[str, Any]:
    """20 steps of the microwave, then 30 of the kettle; of these the first 5 a stitch if asked."""
    phases = ["execute"] * 20 + ["stitch" if stitched else "execute"] * 5 + ["execute"] * 25
    at = [0.1, -1.8, 1.8, -2.5, 0.3, 0.7, 1.6, 0.0, 0.0, *[0.0] * 14, -0.27, 0.35, 1.62, 1, 0, 0, 0]
    return {
        "method": method,
        "accomplished": 1 + stitched,
        "positions": [at] * 50,
        "skill": ["microwave"] * 20 + ["kettle"] * 30,
        "phase": phases,
        "value": np.linspace(-9, 0, 50).tolist(),
        "spread": [0.5] * 50,
    }


def kitchen_stitch(episode: int, without: bool, stitched: bool, worth: float) -> dict[str, Any]:
    """Two steps, each to gain 1; `worth` is what it did, and sets the variances and distances."""
    doubt = 1 - worth
    return {
        "first": "microwave",
        "second": "kettle",
        "episode": episode,
        "succeeds_without": without,
        "succeeds_with": stitched,
        "steps_without": 60,
        "steps_with": 62,
        "value": [-9.0, -9.0 + worth, -9.0 + 2 * worth],
        "spread": [0.5] * 3,
        "distance": [0.2, 0.2 + 0.1 * doubt, 0.2 + 0.2 * doubt],
        "plans": [
            {"step": step, "value": -8.0 + step * worth, "spread": 0.5 + doubt,
             "disagreement": 0.1, "objective": -7.0}
            for step in (0, 1)
        ],
    }  # fmt: skip


def kitchen_stitches() -> dict[str, Any]:
    """Two stitches that helped, one that hurt, and one that had nothing to do."""
    nothing = kitchen_stitch(3, True, True, 0.0)
    for name in ("value", "spread", "distance"):
        nothing[name] = nothing[name][:1]
    return {
        "episodes": 5,
        "limit": 5,
        "alpha": 7.0,
        "beta": 5.0,
        "typical_distance": {"kettle": 0.1, "light switch": None},
        "pairs": [{"first": "microwave", "second": "kettle", "arrived": 4}],
        "stitches": [
            kitchen_stitch(0, False, True, 0.5),
            kitchen_stitch(1, False, True, 1.0),
            kitchen_stitch(2, True, False, -1.0),
            nothing | {"plans": []},
        ],
    }


def kitchen_first_skills() -> dict[str, Any]:
    """The same, with stitches to first skills: two that hurt."""
    study = kitchen_stitches()
    firsts = [kitchen_stitch(episode, True, False, -1.0) | {"first": ""} for episode in (0, 1)]
    return study | {
        "pairs": [{"first": "", "second": "kettle", "arrived": 2}, *study["pairs"]],
        "stitches": [*firsts, *study["stitches"]],
    }


def kitchen_files() -> dict[str, Any]:
    """Everything beside the segments, by the name of its JSON file."""
    curve = np.linspace(-5, 0, 21).tolist()
    errors = {"relative": 0.2, "rmse": 0.1}
    return {
        "spec": kitchen_spec(),
        "datasets": [
            {"name": f"demonstrations-{n}", "orders": [order]} for n, order in enumerate(ORDERS)
        ],
        "showcase": {
            "kind": "physics",
            "benchmark": "kitchen",
            "task": "microwave>kettle",
            "episode": 2,
            "of_episodes": 10,
            "accomplished_by_all": {"no-stitch": [1] * 10, "mb-stitch": [1, 1, *[2] * 8]},
            "episodes": [kitchen_episode("no-stitch", False), kitchen_episode("mb-stitch", True)],
        },
        "stitches": kitchen_stitches(),
        "diagnosis": {
            "predictions": {
                steps: {
                    "states": 100,
                    "groups": {"arm positions": errors, "object positions": errors},
                    "disagreement_rank_correlation": 0.7,
                    "points": [[0.01, 0.02], [0.1, 0.3]],
                }
                for steps in ("1", "5")
            },
            "values": {
                skill: {"demonstrations": 3, "rank_correlation": 0.9, "mean": curve,
                        "spread": [0.5] * 21, "curves": [curve] * 3}
                for skill in SKILLS
            },
            "prices": {
                skill: {"states": 30, "value_spread": 0.04, "dynamics_spread": 0.08}
                for skill in SKILLS
            },
            "competence": {
                skill: {"trials": 100, "successes": 97, "steps": 50.0} for skill in SKILLS
            },
            "forecast": [
                {"first": first, "second": second, "distance": abs(near - 1.0), "success": near}
                for near, (first, second) in zip(
                    np.linspace(0.9, 0.05, 12).tolist(), permutations(SKILLS, 2), strict=True
                )
            ],
        },
    }  # fmt: skip


def write_kitchen(write_run: Callable[..., Path], run_dir: Path, **files: Any) -> Path:
    return write_run(run_dir, kitchen_segments(), **{**kitchen_files(), **files})

"""A synthetic run: a maze whose skills succeed with known probabilities, played as a tree.

The files are those the orchestrator writes; nothing here trains or simulates.
"""

import json
from collections.abc import Callable
from itertools import permutations
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from analysis.schema import RunSpec

SKILLS = ["g0", "g1", "g2", "g3"]
LABELS = {
    "no-stitch": "No-Stitch",
    "random-stitch": "Random-Stitch",
    "mf-stitch": "MF-Stitch",
    "mb-stitch": "MB-Stitch",
}
LATER_SKILL = {"no-stitch": 0.17, "random-stitch": 0.25, "mf-stitch": 0.28, "mb-stitch": 0.95}
"""The probability that a skill after the first succeeds; the first always does."""

LAYOUT = [
    "#########",
    "#.......#",
    "#.......#",
    "#.......#",
    "#.......#",
    "#..#.#..#",
    "#..#.#..#",
    "#..#.#..#",
    "#########",
]


def make_spec(
    seeds: int = 3, episodes: int = 10, lengths: tuple[int, ...] = (2, 3, 4)
) -> dict[str, Any]:
    return {
        "name": "table1",
        "title": "MazeRunner: all permutations of goals",
        "benchmark": "maze",
        "scale": "quick",
        "skills": SKILLS,
        "methods": [{"name": name, "label": label} for name, label in LABELS.items()],
        "seeds": list(range(seeds)),
        "episodes": episodes,
        "tasks": [">".join(task) for n in lengths for task in permutations(SKILLS, n)],
        "step_limits": {"1": 50, "2": 50, "3": 50, "4": 50},
        "tables": [
            {
                "id": "table1",
                "paper": "1",
                "rows": "length",
                "noun": "goals",
                "title": "Table 1: average scores on MazeRunner",
            }
        ],
    }


def make_segments(spec: dict[str, Any], rng: np.random.Generator) -> pd.DataFrame:
    """Plays the tree of all prefixes: a node goes on from its parent's successes."""
    walks = {tuple(task.split(">")) for task in spec["tasks"]}
    nodes = {walk[:depth] for walk in walks for depth in range(1, len(walk) + 1)}
    prefixes = sorted(nodes, key=lambda prefix: (len(prefix), prefix))
    rows: list[dict[str, Any]] = []
    for seed in spec["seeds"]:
        for episode in range(spec["episodes"]):
            first_ends: dict[tuple[str, ...], int] = {}
            for prefix in (p for p in prefixes if len(p) == 1):
                steps = int(rng.integers(5, 10))
                first_ends[prefix] = steps
                rows.append(_segment(seed, "", prefix, episode, True, 0, steps, steps, np.nan))
            for method in (m["name"] for m in spec["methods"]):
                ends = dict(first_ends)
                for prefix in (p for p in prefixes if p[:-1] in ends):
                    success = bool(rng.random() < LATER_SKILL[method])
                    stitch = 0 if method == "no-stitch" else int(rng.integers(1, 6))
                    start = ends[prefix[:-1]]
                    steps = stitch + int(rng.integers(4, 9)) if success else 60 - start
                    rows.append(
                        _segment(seed, method, prefix, episode, success, stitch, steps,
                                 start + steps, float(rng.random()))
                    )  # fmt: skip
                    if success:
                        ends[prefix] = start + steps
    return pd.DataFrame(rows)


def _segment(
    seed: int, method: str, prefix: tuple[str, ...], episode: int, success: bool,
    stitch: int, steps: int, end: int, value: float,
) -> dict[str, Any]:  # fmt: skip
    return {
        "seed": seed,
        "method": method,
        "prefix": ">".join(prefix),
        "depth": len(prefix),
        "episode": episode,
        "success": success,
        "stitch_steps": stitch,
        "steps": steps,
        "end_step": end,
        "value_start": value,
        "value_end": value + 0.1,
    }


def make_showcase() -> dict[str, Any]:
    """Skill paths, a direct chain that gets stuck, and a stitched episode that arrives."""
    goals = {"g0": [2, 1], "g1": [2, 7], "g2": [7, 7], "g3": [7, 1]}
    spine = [[row, 4] for row in range(7, 2, -1)]
    paths = {
        "g0": [*spine, [3, 3], [3, 2], [2, 2], [2, 1]],
        "g1": [*spine, [3, 5], [3, 6], [2, 6], [2, 7]],
        "g2": [*spine[:4], [4, 5], [4, 6], [5, 6], [6, 6], [7, 6], [7, 7]],
        "g3": [*spine[:4], [4, 3], [4, 2], [5, 2], [6, 2], [7, 2], [7, 1]],
    }
    stitched = [*paths["g0"], [3, 1], [3, 2], [3, 3], [3, 4], [3, 5], [3, 6], [2, 6], [2, 7]]
    phases = ["execute"] * (len(paths["g0"]) - 1) + ["stitch"] * 3 + ["execute"] * 5
    skills = ["g0"] * (len(paths["g0"]) - 1) + ["g1"] * 8
    stuck = [*paths["g0"], *[[1, 1], [2, 1]] * 4]
    task = "g0>g1>g3>g2"
    return {
        "kind": "map",
        "layout": LAYOUT,
        "spawn": [7, 4],
        "goals": goals,
        "demonstrations": {skill: [path] for skill, path in paths.items()},
        "episodes": [
            {"method": "no-stitch", "task": task, "positions": stuck, "accomplished": 1,
             "phases": ["execute"] * (len(stuck) - 1),
             "skills": ["g0"] * (len(paths["g0"]) - 1) + ["g1"] * 8},
            {"method": "mb-stitch", "task": task, "positions": stitched, "accomplished": 2,
             "phases": phases, "skills": skills},
        ],
    }  # fmt: skip


def make_training() -> list[dict[str, Any]]:
    steps = list(range(0, 10_000, 500))
    return [
        {
            "kind": kind,
            "seed": seed,
            "name": kind,
            "curves": {
                name: [[step, scale * (1 + seed / 5) / (1 + step / 1000)] for step in steps]
                for name, scale in curves.items()
            },
        }
        for kind, curves in {
            "agent": {"value_loss": 0.1, "actor_loss": 2.0},
            "dynamics": {"loss": 1.0},
        }.items()
        for seed in range(2)
    ]


@pytest.fixture(scope="session")
def spec_dict() -> Callable[..., dict[str, Any]]:
    return make_spec


@pytest.fixture(scope="session")
def segments_of() -> Callable[[dict[str, Any]], pd.DataFrame]:
    return lambda spec: make_segments(spec, np.random.default_rng(0))


@pytest.fixture(scope="session")
def spec() -> RunSpec:
    return RunSpec.from_dict(make_spec())


@pytest.fixture(scope="session")
def segments() -> pd.DataFrame:
    return make_segments(make_spec(), np.random.default_rng(0))


@pytest.fixture(scope="session")
def write_run(segments: pd.DataFrame) -> Callable[..., Path]:
    """Writes a whole run directory; other segments or files can be given."""

    def write(run_dir: Path, segments: pd.DataFrame = segments, **files: Any) -> Path:
        run_dir.mkdir(parents=True)
        contents = {
            "spec": make_spec(),
            "provenance": {
                "versions": {"python": "3.11"},
                "seconds": {"training": 20.5, "evaluation": 12.5},
                "busy worker seconds": {"training": 38.1, "evaluation": 24.0},
            },
            "training": make_training(),
            "showcase": make_showcase(),
            **files,
        }
        for name, content in contents.items():
            if content is not None:
                (run_dir / f"{name}.json").write_text(json.dumps(content), encoding="utf-8")
        segments.to_parquet(run_dir / "segments.parquet", index=False)
        return run_dir

    return write

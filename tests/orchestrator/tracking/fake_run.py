"""Run directories with made-up results, and what MLflow then shows of them."""

import json
import sqlite3
from contextlib import closing
from itertools import permutations
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from analysis.schema import RunSpec
from analysis.tables.table import build_table
from analysis.tables.writers import to_csv
from orchestrator.tracking.views import METHOD, RUN_ID, SEED

SKILLS = ["g0", "g1", "g2"]
METHODS = {"no-stitch": "No-Stitch", "mf-stitch": "MF-Stitch", "mb-stitch[alpha=2.5]": "MB-Stitch"}
OWN = {"mf-stitch": ["mf-policy"], "mb-stitch[alpha=2.5]": ["dynamics"]}  # beside the agent
SEEDS = [0, 1]
CHILDREN = len(METHODS) * len(SEEDS)


def make_spec() -> dict[str, Any]:
    return {
        "name": "table1",
        "title": "MazeRunner: all permutations of goals",
        "benchmark": "maze",
        "scale": "smoke",
        "skills": SKILLS,
        "methods": [
            {"name": name, "label": label, "models": ["agent", *OWN.get(name, [])]}
            for name, label in METHODS.items()
        ],
        "seeds": SEEDS,
        "episodes": 4,
        "tasks": [">".join(task) for n in (2, 3) for task in permutations(SKILLS, n)],
        "step_limits": {"2": 50, "3": 50},
        "tables": [{"id": "table1", "paper": "1", "rows": "length", "noun": "goals", "title": "T"}],
        "spec": {"episodes": 4, "mb_stitch": {"alpha": 1.0, "cem": {"population": 50}}},
    }


def make_episodes(seed: int = 0) -> pd.DataFrame:
    rng = np.random.default_rng(seed)
    rows = [
        (seed, method, task, task.count(">") + 1, episode, int(rng.integers(task.count(">") + 2)))
        for seed in SEEDS
        for method in METHODS
        for task in make_spec()["tasks"]
        for episode in range(4)
    ]
    frame = pd.DataFrame(
        rows, columns=["seed", "method", "task", "length", "episode", "accomplished"]
    )
    return frame.assign(score=frame["accomplished"] / frame["length"], steps=10)


def write_json(path: Path, content: object) -> None:
    path.write_text(json.dumps(content))


def make_provenance(run_id: str) -> dict[str, Any]:
    """As it is written at the start; what was spent is added at the end."""
    return {
        "run_id": run_id,
        "git_revision": "f00d",
        "versions": {"torch": "2.13.0", "numpy": "1.26.4"},
        "cpu": "some cpu",
    }


def start_run(run_dir: Path, run_id: str = "abc123") -> Path:
    """What a run directory holds before anything was trained."""
    run_dir.mkdir(parents=True)
    write_json(run_dir / "spec.json", make_spec())
    write_json(run_dir / "provenance.json", make_provenance(run_id))
    return run_dir


def train_run(run_dir: Path) -> Path:
    curve = [[step, 1 / step] for step in range(1, 6)]
    write_json(
        run_dir / "training.json",
        [
            {"kind": kind, "seed": seed, "key": f"{kind}{seed}", "curves": {"value_loss": curve}}
            for kind in ("agent", "dynamics", "mf-policy")
            for seed in SEEDS
        ],
    )
    dataset = {"key": "d0", "digest": "e" * 64, "rows": 4154, "episodes": 400}
    write_json(run_dir / "datasets.json", [{"name": "demonstrations", **dataset}])
    return run_dir


def finish_run(run_dir: Path) -> Path:
    path = run_dir / "provenance.json"
    spent = {
        "seconds": {"training": 12.5, "evaluation": 30.0},
        "busy worker seconds": {"training": 11.0, "evaluation": 55.5},
        "counts": {"episodes": 432},
    }
    write_json(path, json.loads(path.read_text()) | spent)
    (run_dir / "report" / "figures").mkdir(parents=True)
    (run_dir / "report" / "index.html").write_text("<html></html>")
    (run_dir / "report" / "figures" / "scores.svg").write_text("<svg/>")
    report(run_dir, make_episodes())
    return run_dir


def report(run_dir: Path, episodes: pd.DataFrame) -> None:
    """The result's files, written by what writes them in earnest."""
    episodes.to_parquet(run_dir / "episodes.parquet")
    spec = RunSpec.from_dict(make_spec())
    table = build_table(episodes, spec, spec.tables[0])
    (run_dir / "report" / "table1.csv").write_text(to_csv(table.scores))
    (run_dir / "report" / "table1-gains.csv").write_text(to_csv(table.gains))


class Seen:
    """What MLflow shows, read through its client."""

    def __init__(self, uri: str, run_id: str = "abc123") -> None:
        from mlflow import MlflowClient

        self.client = MlflowClient(tracking_uri=uri)
        experiment = self.client.get_experiment_by_name("skillstitch/maze")
        assert experiment is not None
        self.experiment = experiment.experiment_id
        runs = [
            run
            for run in self.client.search_runs([self.experiment])
            if run.data.tags[RUN_ID] == run_id
        ]
        (self.parent,) = [run for run in runs if METHOD not in run.data.tags]
        self.children = {
            (run.data.tags[METHOD], int(run.data.tags[SEED])): run
            for run in runs
            if run is not self.parent
        }
        self.count = len(runs)

    def states(self) -> tuple[str, set[str]]:
        return self.parent.info.status, {run.info.status for run in self.children.values()}


def rows(uri: str, table: str) -> int:
    with closing(sqlite3.connect(uri.removeprefix("sqlite:///"))) as connection:
        return connection.execute(f"SELECT COUNT(*) FROM {table}").fetchone()[0]


def rewind(run_dir: Path) -> None:
    """Forget that this was published, as if the receipt had been lost."""
    (run_dir / "tracking.json").unlink()

"""Learning curves while they grow, and what is left of that in the end: nothing."""

import json
import shutil
import sqlite3
import time
from collections.abc import Callable
from contextlib import closing
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from orchestrator.spec.spec import Spec
from orchestrator.tracking import default_uri, live, publish
from orchestrator.tracking.live import Growing, Live
from orchestrator.tracking.metrics import learning_curves
from orchestrator.tracking.receipt import Status
from orchestrator.work import checkpoints
from tests.orchestrator.tiny import Lines, Place, carry_out, serially
from tests.orchestrator.tracking.fake_run import (
    CHILDREN,
    SEEDS,
    Seen,
    finish_run,
    start_run,
    train_run,
)


def metric_rows(database: Path) -> list[tuple[str, str, int, float, int]]:
    query = """SELECT runs.name, metrics.key, step, value, timestamp - start_time
               FROM metrics JOIN runs ON metrics.run_uuid = runs.run_uuid
               WHERE step > 0 ORDER BY 1, 2, 3, 4"""
    if not database.is_file():
        return []
    with closing(sqlite3.connect(database, timeout=30)) as db:
        try:
            return db.execute(query).fetchall()
        except sqlite3.OperationalError:  # its tables are not there yet
            return []


def test_curves_grow_and_end_as_if_they_had_come_whole(
    tmp_path: Path, uri: str, fresh_store: Path
) -> None:
    database = Path(uri.removeprefix("sqlite:///"))
    whole = json.loads((train_run(start_run(tmp_path / "other")) / "training.json").read_text())
    run_dir = start_run(tmp_path / "run")

    def so_far(points: int) -> list[dict[str, Any]]:
        return [
            entry | {"curves": {name: curve[:points] for name, curve in entry["curves"].items()}}
            for entry in whole
        ]

    growing = Growing(list)
    counts = []
    for points in (0, 2, 2, 3):
        growing.read = partial(so_far, points)
        outcome = publish(run_dir, uri, "RUNNING", growing=growing)
        assert outcome.ok
        counts.append(len(metric_rows(database)))
    curves = len(SEEDS) * len(["agent", "agent", "mf-policy", "agent", "dynamics"])
    assert counts == [0, 2 * curves, 2 * curves, 3 * curves]
    assert Seen(uri).states() == ("RUNNING", {"RUNNING"})
    assert publish(run_dir, uri, "RUNNING", growing=growing).skipped  # nothing has grown

    finish_run(train_run(run_dir))
    assert publish(run_dir, uri, "FINISHED").ok
    assert Seen(uri).states() == ("FINISHED", {"FINISHED"})
    grown = metric_rows(database)
    assert len(grown) == 5 * curves

    at_once = tmp_path / "another" / "mlflow.db"
    at_once.parent.mkdir()
    shutil.copy(fresh_store, at_once)
    assert publish(run_dir, default_uri(at_once.parent), "FINISHED").ok
    assert metric_rows(at_once) == grown


@pytest.mark.parametrize("status", ["FAILED", "KILLED"])
def test_work_that_breaks_off_keeps_its_curves(tmp_path: Path, uri: str, status: Status) -> None:
    """Before training.json is there, and while the same command goes on."""
    run_dir = start_run(tmp_path / "run")
    other = train_run(start_run(tmp_path / "other")) / "training.json"
    training = json.loads(other.read_text())
    growing = Growing(lambda: training)
    assert publish(run_dir, uri, "RUNNING", growing=growing).ok
    curves = metric_rows(Path(uri.removeprefix("sqlite:///")))
    assert curves
    steps: list[tuple[Status, Growing | None]] = [(status, None), ("RUNNING", Growing(list))]
    for now, growing_now in (*steps, *steps):
        assert publish(run_dir, uri, now, growing=growing_now).ok
        seen = Seen(uri)
        assert seen.states() == (now, {now})
        assert len(seen.children) == CHILDREN
        assert metric_rows(Path(uri.removeprefix("sqlite:///"))) == curves


@pytest.mark.slow
def test_a_run_shows_its_curves_before_it_has_written_them(
    place: Place, spec: Spec, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(live, "SECONDS_BETWEEN", 0.05)
    monkeypatch.setattr(checkpoints, "SECONDS_BETWEEN_NEWS", 0.0)
    database = place.root / "mlflow.db"
    seen_live = []

    class Waiting(Lines):
        """Goes on to evaluate when MLflow shows what was trained."""

        def phase(self, name: str, total: int, done: int) -> None:
            super().phase(name, total, done)
            if name == "evaluation":
                wait_until(lambda: any("agent/" in key for _, key, *_ in metric_rows(database)))
                assert not (place.out / "training.json").exists()
                seen_live.extend(metric_rows(database))

    settings = replace(serially(place.out, place.store_root), tracking_uri=None)
    carry_out(spec, settings, Waiting())
    rows = metric_rows(database)
    assert seen_live
    assert set(seen_live) <= set(rows)
    training = place.directory.read_json("training.json")
    models = {one["name"]: one["models"] for one in place.directory.asked()["methods"]}
    run_id = place.directory.read_json("identity.json")["run_id"][:4]
    assert [row[:4] for row in rows] == sorted(
        (f"{method} · seed {seed} · {run_id}", name, step, value)
        for method in spec.methods
        for seed in range(spec.seeds)
        for name, curve in learning_curves(method, models[method], seed, training).items()
        for step, value in curve
    )


def wait_until(condition: Callable[[], bool]) -> None:
    deadline = time.monotonic() + 60
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.05)


def test_a_publication_that_fails_stops_nothing(tmp_path: Path, uri: str) -> None:
    def fails() -> list[dict[str, Any]]:
        raise OSError("the store is gone")

    run_dir = start_run(tmp_path / "run")
    outcomes = []
    with Live(
        lambda ending: outcomes.append(
            publish(run_dir, uri, "RUNNING", ending, Growing(fails)).error
        ),
        seconds=0.01,
    ):
        wait_until(lambda: len(outcomes) > 2)
    assert all("the store is gone" in error for error in outcomes)

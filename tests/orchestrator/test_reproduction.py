"""A whole reproduction on the serial executor: once, again, and after it was stopped."""

import shutil
import threading
from typing import Any

import numpy as np
import pandas as pd
import pytest

from orchestrator.spec.spec import Spec
from orchestrator.storage import locking
from orchestrator.storage.ledger import Ledger
from orchestrator.storage.store import Artifact, Store
from orchestrator.work.plan import Plan
from tests.orchestrator.tiny import Counted, Lines, Place, carry_out, promised_bytes, serially
from tests.rows import row


class KilledError(Exception):
    """Stands for whatever ends the driver between two statements."""


def test_everything_is_done_once(spec: Spec, plan: Plan, place: Place, counted: Counted) -> None:
    lines = Lines()
    directory = place.carry_out(spec, lines)
    assert counted.built == dict.fromkeys(plan.recipes, 1)
    assert set(counted.played.values()) == {1}
    assert set(counted.played) == place.finished_blocks() <= {t.key for t in plan.tasks.values()}
    assert lines.phases == {
        "training": (len(plan.needed), 0),
        "evaluation": (len(plan.tasks), 0),
        "illustrations": (1, 0),
    }
    assert directory.finished
    segments = pd.read_parquet(directory.path / "segments.parquet")
    counts = directory.read_json("provenance.json")["counts"]
    assert counts["segments played"] == len(segments)
    episodes = pd.read_parquet(directory.path / "episodes.parquet")
    assert len(episodes) == len(spec.all_tasks) * len(spec.methods) * spec.seeds * spec.episodes


def test_the_showcase_shows_what_was_evaluated(done: Place) -> None:
    """Its episode is the first of the evaluation's: as many steps, of which as many stitched."""
    segments = pd.read_parquet(done.out / "segments.parquet")
    first = segments.query("seed == 0 and episode == 0").set_index(["method", "prefix"])
    for shown in done.directory.read_json("showcase.json")["episodes"]:
        skills, phases = np.array(shown["skills"]), np.array(shown["phases"])
        task = shown["task"].split(">")
        for depth, skill in enumerate(task[: shown["accomplished"] + 1], start=1):
            played = row(first, shown["method"] if depth > 1 else "", ">".join(task[:depth]))
            assert played.steps == (skills == skill).sum()
            assert played.stitch_steps == (phases[skills == skill] == "stitch").sum()
            assert played.success == (depth <= shown["accomplished"])


def test_again_does_nothing(spec: Spec, done: Place, counted: Counted) -> None:
    before = {path: path.stat().st_mtime_ns for path in done.out.rglob("*.*")}
    del before[done.out / "identity.json"]
    done.carry_out(spec)
    assert not counted.built
    assert not counted.played
    for name in ("episodes.parquet", "segments.parquet", "provenance.json", "report/table1.csv"):
        assert (done.out / name).stat().st_mtime_ns == before[done.out / name]


@pytest.mark.parametrize("k", [0, 1, 5])
def test_resumes_where_the_ledger_ends(
    spec: Spec,
    trained: Place,
    expected: dict[str, bytes],
    counted: Counted,
    monkeypatch: pytest.MonkeyPatch,
    k: int,
) -> None:
    """The driver ends right before, and then right after, its k-th record of blocks."""
    record = Ledger.record
    calls = []

    def dying_before(self: Ledger, outcomes: list[tuple[str, bytes]]) -> None:
        if self.path == trained.out / "ledger.sqlite":
            calls.append(len(list(outcomes)))
            if len(calls) == k + 2:  # the first only takes over what earlier runs have played
                raise KilledError
        record(self, outcomes)

    def dying_after(self: Ledger, outcomes: list[tuple[str, bytes]]) -> None:
        record(self, outcomes)
        if self.path == trained.out / "ledger.sqlite":
            calls.append(0)
            if len(calls) == 2:
                raise KilledError

    monkeypatch.setattr(Ledger, "record", dying_before)
    with pytest.raises(KilledError):
        trained.carry_out(spec)
    assert len(trained.finished_blocks()) == sum(calls[:-1])
    assert not trained.directory.finished

    calls.clear()
    monkeypatch.setattr(Ledger, "record", dying_after)
    with pytest.raises(KilledError):
        trained.carry_out(spec)

    monkeypatch.undo()
    trained.carry_out(spec)
    assert promised_bytes(trained.out) == expected


@pytest.mark.parametrize("k", [1, 3])
def test_resumes_where_training_ended(
    spec: Spec,
    plan: Plan,
    place: Place,
    expected: dict[str, bytes],
    counted: Counted,
    monkeypatch: pytest.MonkeyPatch,
    k: int,
) -> None:
    write = Store.write
    written: list[str] = []

    def dying(self: Store, kind: str, key: str, artifact: Artifact, made: dict[str, Any]) -> str:
        if len(written) == k:
            raise KilledError
        written.append(key)
        return write(self, kind, key, artifact, made)

    monkeypatch.setattr(Store, "write", dying)
    with pytest.raises(KilledError):
        place.carry_out(spec)
    monkeypatch.setattr(Store, "write", write)
    counted.built.clear()
    place.carry_out(spec)
    assert set(counted.built) == set(plan.recipes) - set(written)
    assert promised_bytes(place.out) == expected


@pytest.mark.parametrize("store", ["store", "."])
def test_the_store_may_lie_in_the_run_directory(spec: Spec, trained: Place, store: str) -> None:
    """As runs/store does for a run with --out runs."""
    out = trained.root / "runs"
    shutil.copytree(trained.store_root, out / store, dirs_exist_ok=True)
    directory = carry_out(spec, serially(out, out / store))
    assert directory.finished
    assert directory.store_root == (out / store).resolve()


def test_a_run_waits_while_its_store_is_cleaned(spec: Spec, done: Place) -> None:
    waiting, progress = threading.Event(), Lines()

    def run() -> None:
        carry_out(spec, serially(done.out, done.store_root), progress)
        waiting.set()

    with locking.alone(done.store_root):
        thread = threading.Thread(target=run)
        thread.start()
        assert not waiting.wait(0.5)
    thread.join(60)
    assert waiting.is_set()
    assert progress.lines == [f"waiting for the gc of {done.store_root} to end"]

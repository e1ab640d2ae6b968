"""Episodes that fail every time, and an MLflow store that is gone and comes back."""

import sqlite3
from collections.abc import Callable, Mapping
from contextlib import closing
from dataclasses import replace
from functools import cache
from pathlib import Path
from unittest import mock

from orchestrator.errors import IncompleteError
from orchestrator.storage.ledger import Outcome
from orchestrator.storage.store import Artifact
from orchestrator.work.jobs import BlockTask
from orchestrator.work.plan import Node, Plan, make_plan
from orchestrator.work.playing import BlockPlayer
from stitching.rollout import Recorder
from tests.campaign.ground import Fault, Ground, randomness
from tests.orchestrator.launched import in_a_process, run_tracked, statuses
from tests.orchestrator.tiny import Lines, Place, carry_out, serially

MOST_POISONOUS = 4  # blocks


def episodes(ground: Ground, trial: int) -> str:
    """Some blocks raise whenever they are played: they are given up, and all others finish."""
    rng = randomness("episodes", trial)
    place, plan = ground.trained(), make_plan(ground.spec)
    tasks = list(plan.tasks)
    chosen = rng.choice(len(tasks), rng.integers(1, MOST_POISONOUS + 1), replace=False)
    poisonous = {plan.tasks[tasks[number]].key for number in chosen}
    play = BlockPlayer.outcome

    def poisoned(
        self: BlockPlayer,
        task: BlockTask,
        parent: Outcome | None,
        artifacts: Mapping[str, Artifact],
        recorder: Recorder | None = None,
    ) -> Outcome:
        if task.key in poisonous:
            raise RuntimeError("a poisonous episode")
        return play(self, task, parent, artifacts, recorder)

    lost = {
        task.key
        for (node, chunk), task in plan.tasks.items()
        if any(plan.tasks[above, chunk].key in poisonous for above in _lineage(plan, node))
    } & set(ground.outcomes)
    with mock.patch.object(BlockPlayer, "outcome", poisoned):
        try:
            place.carry_out(ground.spec)
            told = "none of them was reached"
        except IncompleteError as error:
            told = str(error).partition(" (")[0]
    assert place.finished_blocks() == set(ground.outcomes) - lost
    assert bool(lost) == told.endswith("given up after repeated failures")
    ground.resume(place)
    return f"{len(chosen)} blocks, {len(lost)} lost with them: {told}"


def _lineage(plan: Plan, node: Node | None) -> list[Node]:
    """A node and those above it."""
    return [] if node is None else [node, *_lineage(plan, node.parent)]


def mlflow(ground: Ground, trial: int) -> str:
    """In its place stands something else; when that is gone, the next command makes up for it."""
    name, put = list(IN_ITS_PLACE.items())[trial % len(IN_ITS_PLACE)]
    expected = _metrics(_tracked(ground))
    place, lines = ground.done(), Lines()
    settings = replace(serially(place.out, place.store_root), tracking_uri=None)
    database = place.root / "mlflow.db"
    put(database)
    carry_out(ground.spec, settings, lines)
    ground.check(place)
    assert "tracking: " in lines.text
    assert "the next command publishes what was missed" in lines.text
    database.rmdir() if database.is_dir() else database.unlink()
    again = in_a_process(run_tracked, place)  # MLflow keeps connections to what is gone
    again.join()
    assert again.exitcode == 0
    ground.check(place)
    assert set(statuses(place)) == {"FINISHED"}
    assert _metrics(place) == expected
    return name


IN_ITS_PLACE: dict[str, Callable[[Path], object]] = {
    "a folder": Path.mkdir,
    "a file of another kind": lambda path: path.write_bytes(b"no database" * 1000),
    "a database of another program": lambda path: _another_database(path),
}


def _another_database(path: Path) -> None:
    with closing(sqlite3.connect(path)) as db:
        db.execute("CREATE TABLE runs (name TEXT)")
        db.commit()


@cache
def _tracked(ground: Ground) -> Place:
    """The undisturbed run as MLflow shows it."""
    place = ground.done()
    carry_out(ground.spec, replace(serially(place.out, place.store_root), tracking_uri=None))
    return place


def _metrics(place: Place) -> list[tuple[str, str, int, float]]:
    """All that MLflow has of scores and curves: run, metric, step, value."""
    query = """SELECT runs.name, metrics.key, step, value
               FROM metrics JOIN runs ON metrics.run_uuid = runs.run_uuid ORDER BY 1, 2, 3, 4"""
    with closing(sqlite3.connect(place.root / "mlflow.db")) as db:
        return db.execute(query).fetchall()


FAULTS = (
    Fault("episodes that fail every time", episodes, 40, (0, 1)),
    Fault("MLflow gone and back", mlflow, 6),
)

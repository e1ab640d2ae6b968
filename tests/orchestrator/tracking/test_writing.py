"""Publishing again, and after kills, completes what is there and doubles nothing."""

from pathlib import Path

import pytest

from orchestrator.tracking import PublishOutcome, publish, writing
from orchestrator.tracking.views import METHOD, RUN_ID, SEED
from orchestrator.tracking.writing import CONTENT
from tests.orchestrator.tracking.fake_run import (
    CHILDREN,
    Seen,
    make_episodes,
    make_spec,
    report,
    rewind,
    rows,
    write_json,
)


def test_republishing_makes_no_duplicates(run_dir: Path, uri: str) -> None:
    publish(run_dir, uri, "FINISHED")
    before = {table: rows(uri, table) for table in ("runs", "metrics", "inputs", "datasets")}
    rewind(run_dir)
    assert publish(run_dir, uri, "FINISHED") == PublishOutcome(ok=True)
    assert {table: rows(uri, table) for table in before} == before


def test_republishing_what_was_published_in_part_makes_no_duplicates(
    run_dir: Path, uri: str
) -> None:
    publish(run_dir, uri, "FINISHED")
    before = {table: rows(uri, table) for table in ("runs", "metrics", "inputs", "datasets")}
    seen = Seen(uri)
    for run in (seen.parent, *seen.children.values()):  # none is known to be complete
        seen.client.delete_tag(run.info.run_id, CONTENT)
    rewind(run_dir)
    assert publish(run_dir, uri, "FINISHED").ok
    assert {table: rows(uri, table) for table in before} == before


def test_changed_scores_replace_the_old_ones(run_dir: Path, uri: str) -> None:
    publish(run_dir, uri, "FINISHED")
    report(run_dir, make_episodes().assign(accomplished=0, score=0.0))
    assert publish(run_dir, uri, "FINISHED").ok
    seen = Seen(uri)
    assert seen.parent.data.metrics["table1/2_goals/no-stitch/score"] == 0
    assert seen.children["no-stitch", 0].data.metrics["table1/2_goals/score"] == 0
    curve = seen.client.get_metric_history(
        seen.children["no-stitch", 0].info.run_id, "agent/value_loss"
    )
    assert len(curve) == 5


def test_changed_params_make_a_new_run(run_dir: Path, uri: str) -> None:
    publish(run_dir, uri, "FINISHED")
    write_json(run_dir / "spec.json", make_spec() | {"spec": {"episodes": 3}})
    assert publish(run_dir, uri, "FINISHED").ok
    seen = Seen(uri)
    assert seen.count == 1 + CHILDREN
    assert seen.parent.data.params["episodes"] == "3"


def test_what_a_kill_left_running_is_reconciled(run_dir: Path, uri: str) -> None:
    publish(run_dir, uri, "FINISHED")
    seen = Seen(uri)
    for run in (seen.parent, seen.children["mf-stitch", 1]):
        seen.client.update_run(run.info.run_id, status="RUNNING")
    doubles = [
        seen.client.create_run(seen.experiment, tags=tags)
        for tags in (
            {RUN_ID: "abc123", METHOD: "mf-stitch", SEED: "1"},
            {RUN_ID: "abc123", METHOD: "a method of old", SEED: "1"},
            {RUN_ID: "abc123"},
        )
    ]
    rewind(run_dir)
    assert publish(run_dir, uri, "FINISHED").ok

    after = Seen(uri)
    assert after.states() == ("FINISHED", {"FINISHED"})
    assert after.count == 1 + CHILDREN
    from mlflow.entities import ViewType

    every = after.client.search_runs([after.experiment], run_view_type=ViewType.ALL)
    assert {run.info.status for run in every} == {"FINISHED", "KILLED"}
    assert len(every) == 1 + CHILDREN + len(doubles)


@pytest.mark.parametrize(
    "step", ["create_run", "log_batch", "log_artifact", "set_tag", "set_terminated"]
)
def test_a_publish_that_breaks_off_is_completed_by_the_next(
    run_dir: Path, uri: str, step: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    from mlflow import MlflowClient

    real, calls = getattr(MlflowClient, step), iter(range(100))

    def dies_the_second_time(self: MlflowClient, *args: object, **kwargs: object) -> object:
        if next(calls) == 1:
            raise KeyboardInterrupt
        return real(self, *args, **kwargs)

    monkeypatch.setattr(MlflowClient, step, dies_the_second_time)
    with pytest.raises(KeyboardInterrupt):
        publish(run_dir, uri, "FINISHED")
    monkeypatch.undo()
    outcome = publish(run_dir, uri, "FINISHED")
    assert outcome.ok
    assert not outcome.skipped
    seen = Seen(uri)
    assert seen.states() == ("FINISHED", {"FINISHED"})
    assert seen.count == rows(uri, "runs") == 1 + CHILDREN


def test_a_slow_store_gets_the_rest_next_time(
    run_dir: Path, uri: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(writing, "PUBLISH_SECONDS", 0.0)
    assert "more than" in publish(run_dir, uri, "FINISHED").error
    monkeypatch.undo()
    assert publish(run_dir, uri, "FINISHED").ok
    assert Seen(uri).count == 1 + CHILDREN

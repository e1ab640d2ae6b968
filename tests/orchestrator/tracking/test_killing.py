"""Runs that were interrupted: KILLED at once, or by the next command."""

import time
from pathlib import Path
from threading import Event

import pytest

from orchestrator.errors import StorageError
from orchestrator.storage.rundir import RunDirectory
from orchestrator.tracking import Live, killing, live, mark_killed, publish
from orchestrator.tracking.receipt import Receipt, read_receipt
from orchestrator.tracking.run import catch_up
from tests.orchestrator.tracking.fake_run import Seen, start_run, train_run


@pytest.fixture
def running(tmp_path: Path, uri: str) -> Path:
    """A run that MLflow shows as under way, with a child for each method and seed."""
    run_dir = train_run(start_run(tmp_path / "run"))
    assert publish(run_dir, uri, "RUNNING").ok
    assert Seen(uri).states() == ("RUNNING", {"RUNNING"})
    return run_dir


def test_an_interrupted_run_is_killed_and_goes_on(running: Path, uri: str) -> None:
    mark_killed(running, uri)
    seen = Seen(uri)
    assert seen.states() == ("KILLED", {"KILLED"})
    assert seen.parent.info.end_time is not None

    assert publish(running, uri, "RUNNING").ok
    assert Seen(uri).states() == ("RUNNING", {"RUNNING"})
    assert publish(running, uri, "FINISHED").ok
    assert Seen(uri).states() == ("FINISHED", {"FINISHED"})


def test_what_this_work_has_not_touched_stays_as_it_is(run_dir: Path, uri: str) -> None:
    mark_killed(run_dir, uri)  # nothing was published
    assert read_receipt(run_dir) is None
    assert publish(run_dir, uri, "FINISHED").ok
    mark_killed(run_dir, uri)
    assert publish(run_dir, uri, "FINISHED").skipped
    assert Seen(uri).states() == ("FINISHED", {"FINISHED"})


def test_a_store_that_does_not_answer_keeps_nobody_waiting(
    running: Path, uri: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(killing, "SECONDS_TO_KILL", 0.2)
    monkeypatch.setattr(killing, "kill_runs", lambda *_: time.sleep(5))
    began = time.monotonic()
    mark_killed(running, uri)
    assert time.monotonic() - began < 2
    monkeypatch.undo()
    assert catch_up(RunDirectory(running)) == ""  # as `skillstitch status` does
    assert Seen(uri).states() == ("KILLED", {"KILLED"})


def test_a_run_whose_process_is_gone_is_killed_by_the_next_command(running: Path, uri: str) -> None:
    assert catch_up(RunDirectory(running)) == ""
    assert Seen(uri).states() == ("KILLED", {"KILLED"})


def test_a_run_that_gave_up_blocks_stays_finished(run_dir: Path, uri: str) -> None:
    directory = RunDirectory(run_dir)
    directory.write_json("quarantine.json", [{"seed": 0}])
    directory.mark(finished=True)
    assert publish(run_dir, uri, "FINISHED").ok
    (run_dir / "report" / "index.md").write_text("written again")
    assert catch_up(directory) == ""
    assert Seen(uri).states() == ("FINISHED", {"FINISHED"})


def test_a_directory_that_cannot_be_written_to_does_not_keep_mlflow_from_knowing(
    running: Path, uri: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refused(run_dir: Path, receipt: Receipt) -> None:
        raise StorageError(f"cannot write {run_dir}")

    monkeypatch.setattr(killing, "write_receipt", refused)
    mark_killed(running, uri)
    assert Seen(uri).states() == ("KILLED", {"KILLED"})


def test_what_comes_after_the_end_changes_nothing(running: Path, uri: str) -> None:
    mark_killed(running, uri)
    before = read_receipt(running)
    ending = Event()
    ending.set()
    assert "the work ended" in publish(running, uri, "RUNNING", ending).error
    assert read_receipt(running) == before
    assert Seen(uri).states() == ("KILLED", {"KILLED"})


@pytest.mark.parametrize(("step", "parents"), [("search_runs", []), ("set_tag", ["RUNNING"])])
def test_a_publication_breaks_off_before_it_begins_and_before_it_settles(
    tmp_path: Path, uri: str, step: str, parents: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    from mlflow import MlflowClient

    real, ending = getattr(MlflowClient, step), Event()

    def ends_meanwhile(self: MlflowClient, *args: object, **kwargs: object) -> object:
        ending.set()
        return real(self, *args, **kwargs)

    monkeypatch.setattr(MlflowClient, step, ends_meanwhile)
    outcome = publish(start_run(tmp_path / "run"), uri, "FINISHED", ending)
    monkeypatch.undo()
    assert "the work ended" in outcome.error
    client = MlflowClient(tracking_uri=uri)
    experiment = client.get_experiment_by_name("skillstitch/maze")
    assert experiment is not None
    runs = client.search_runs([experiment.experiment_id])
    assert [run.info.status for run in runs] == parents


def test_a_publication_under_way_breaks_off_when_the_work_does(
    running: Path, uri: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(live, "SECONDS_TO_END", 0.2)
    outcomes = []
    with (
        pytest.raises(KeyboardInterrupt),
        Live(
            lambda ending: outcomes.append((ending.wait(), publish(running, uri, "FAILED", ending)))
        ),
    ):
        raise KeyboardInterrupt
    deadline = time.monotonic() + 30
    while not outcomes:
        assert time.monotonic() < deadline
        time.sleep(0.01)
    ((_, outcome),) = outcomes
    assert "the work ended" in outcome.error
    assert Seen(uri).states() == ("RUNNING", {"RUNNING"})


def test_work_under_way_is_published_again_and_again() -> None:
    times: list[float] = []
    with Live(lambda ending: times.append(time.monotonic()), seconds=0.02):
        time.sleep(0.3)
    assert len(times) > 2
    ended = len(times)
    time.sleep(0.1)
    assert len(times) == ended

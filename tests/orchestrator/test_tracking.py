"""The MLflow view, against real SQLite stores and, in the long tail, a real server."""

import json
import os
import shutil
import socket
import sqlite3
import subprocess
import sys
import threading
import time
import urllib.request
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from itertools import permutations
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from analysis.run import RunSpec
from analysis.tables import build_table
from analysis.writers import to_csv
from orchestrator import tracking
from orchestrator.tracking import CONTENT, METHOD, RUN_ID, SEED, default_uri, pending, publish

SKILLS = ["g0", "g1", "g2"]
METHODS = {"no-stitch": "No-Stitch", "mf-stitch": "MF-Stitch", "mb-stitch[alpha=2.5]": "MB-Stitch"}
SEEDS = [0, 1]
CHILDREN = len(METHODS) * len(SEEDS)


def make_spec() -> dict:
    return {
        "name": "table1",
        "title": "MazeRunner: all permutations of goals",
        "benchmark": "maze",
        "scale": "smoke",
        "skills": SKILLS,
        "methods": [{"name": name, "label": label} for name, label in METHODS.items()],
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


def start_run(run_dir: Path, run_id: str = "abc123") -> Path:
    """What a run directory holds before anything was trained."""
    run_dir.mkdir(parents=True)
    write_json(run_dir / "spec.json", make_spec())
    provenance = {
        "run_id": run_id,
        "git_revision": "f00d",
        "versions": {"torch": "2.13.0", "numpy": "1.26.4"},
        "cpu": "some cpu",
        "timings": {"training": {"agent": 12.5}},
        "counts": {"episodes": 432},
    }
    write_json(run_dir / "provenance.json", provenance)
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


@pytest.fixture
def run_dir(tmp_path: Path) -> Path:
    return finish_run(train_run(start_run(tmp_path / "run")))


@pytest.fixture(scope="session")
def fresh_store(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("store")
    assert tracking.prepare(default_uri(folder)).ok
    return folder / "mlflow.db"


@pytest.fixture
def uri(fresh_store: Path, tmp_path: Path) -> str:
    """A store of its own whose schema was not created anew, which takes seconds."""
    shutil.copy(fresh_store, tmp_path / "mlflow.db")
    return default_uri(tmp_path)


class Seen:
    """What MLflow shows, read through its client."""

    def __init__(self, uri: str, run_id: str = "abc123") -> None:
        from mlflow import MlflowClient

        self.client = MlflowClient(tracking_uri=uri)
        experiment = self.client.get_experiment_by_name("skillstitch/maze")
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


# --- What is shown -----------------------------------------------------------------------------


def test_a_finished_run_is_shown_whole(run_dir: Path, uri: str) -> None:
    assert publish(run_dir, uri, finished=True) == tracking.PublishOutcome(ok=True)
    seen = Seen(uri)
    assert seen.states() == ("FINISHED", {"FINISHED"})
    assert len(seen.children) == CHILDREN

    parent = seen.parent.data
    assert seen.parent.info.run_name == "table1 smoke"
    assert parent.tags["mlflow.source.git.commit"] == "f00d"
    assert parent.tags["version.torch"] == "2.13.0"
    assert parent.tags["skillstitch.scale"] == "smoke"
    assert parent.params["mb_stitch.cem.population"] == "50"
    assert parent.metrics["timings/training/agent"] == 12.5
    assert {
        "table1/2 goals/mf-stitch/score",
        "table1/3 goals/mf-stitch/ci_low",
        "table1/2 goals/mb-stitch alpha 2.5/ci_high",
        "table1/2 goals/mb-stitch alpha 2.5 over no-stitch/gain",
    } <= parent.metrics.keys()

    (dataset,) = seen.parent.inputs.dataset_inputs
    assert dataset.dataset.name == "demonstrations"
    artifacts = {file.path for file in seen.client.list_artifacts(seen.parent.info.run_id)}
    assert artifacts == {"spec.json", "provenance.json", "report"}
    folder = Path(uri.removeprefix("sqlite:///")).parent / "mlartifacts"
    assert [path.name for path in folder.rglob("*.svg")] == ["scores.svg"]


def test_children_show_their_own_scores_and_curves(run_dir: Path, uri: str) -> None:
    publish(run_dir, uri, finished=True)
    seen = Seen(uri)
    episodes = make_episodes()
    means = episodes[episodes["length"] == 2].groupby(["method", "seed"])["score"].mean()
    for own, run in seen.children.items():
        assert run.data.tags["mlflow.parentRunId"] == seen.parent.info.run_id
        names = (f"table1/2 goals/{column}" for column in ("ci_low", "score", "ci_high"))
        low, score, high = (run.data.metrics[name] for name in names)
        assert score == pytest.approx(means[own])
        assert low <= score <= high

    def kinds(method: str) -> set[str]:
        metrics = seen.children[method, 1].data.metrics
        return {name.split("/")[0] for name in metrics if name.endswith("/value_loss")}

    assert kinds("no-stitch") == {"agent"}
    assert kinds("mf-stitch") == {"agent", "mf-policy"}
    assert kinds("mb-stitch[alpha=2.5]") == {"agent", "dynamics"}
    best = seen.children["mb-stitch[alpha=2.5]", 0]
    assert best.data.params["mb_stitch.alpha"] == "2.5"  # the method's own, not the spec's 1.0
    curve = seen.client.get_metric_history(best.info.run_id, "agent/value_loss")
    assert [(point.step, point.value) for point in curve] == [(n, 1 / n) for n in range(1, 6)]


def test_the_life_of_a_run(tmp_path: Path, uri: str) -> None:
    run_dir = start_run(tmp_path / "run")
    assert publish(run_dir, uri, finished=False).ok
    assert Seen(uri).states() == ("RUNNING", set())

    train_run(run_dir)
    assert publish(run_dir, uri, finished=False).ok
    first = Seen(uri)
    assert first.states() == ("RUNNING", {"FINISHED"})

    finish_run(run_dir)
    assert publish(run_dir, uri, finished=True).ok
    last = Seen(uri)
    assert last.states() == ("FINISHED", {"FINISHED"})
    assert last.parent.info.run_id == first.parent.info.run_id
    assert last.children.keys() == first.children.keys()


def test_a_failed_run(tmp_path: Path, uri: str) -> None:
    run_dir = train_run(start_run(tmp_path / "run"))
    assert publish(run_dir, uri, finished=False, failed=True).ok
    assert Seen(uri).states() == ("FAILED", {"FAILED"})
    assert publish(run_dir, uri, finished=False).ok  # the same command again, which resumes
    assert Seen(uri).states() == ("RUNNING", {"FINISHED"})


def test_long_configurations_fit_into_params(tmp_path: Path, uri: str) -> None:
    run_dir = start_run(tmp_path / "run")
    long = {"notes": "x" * 9000, "many": {str(i): i for i in range(150)}}
    write_json(run_dir / "spec.json", make_spec() | {"spec": long})
    assert publish(run_dir, uri, finished=False).ok
    params = Seen(uri).parent.data.params
    assert len(params["notes"]) == tracking.LONGEST_TEXT
    assert params["many.149"] == "149"


def test_several_artifacts_of_a_kind_keep_their_curves_apart() -> None:
    training = [
        {"kind": "agent", "seed": 0, "key": key, "curves": {"loss": [[1, 2.0], [2, float("nan")]]}}
        for key in ("aaaaaaaaaa", "bbbbbbbbbb")
    ]
    curves = tracking._curves("no-stitch", 0, training)
    assert curves == {"agent aaaaaaaa/loss": [(1, 2.0)], "agent bbbbbbbb/loss": [(1, 2.0)]}


# --- Publishing again --------------------------------------------------------------------------


def test_republishing_makes_no_duplicates(run_dir: Path, uri: str) -> None:
    publish(run_dir, uri, finished=True)
    before = {table: rows(uri, table) for table in ("runs", "metrics", "inputs", "datasets")}
    rewind(run_dir)
    assert publish(run_dir, uri, finished=True) == tracking.PublishOutcome(ok=True)
    assert {table: rows(uri, table) for table in before} == before


def test_republishing_what_was_published_in_part_makes_no_duplicates(
    run_dir: Path, uri: str
) -> None:
    publish(run_dir, uri, finished=True)
    before = {table: rows(uri, table) for table in ("runs", "metrics", "inputs", "datasets")}
    seen = Seen(uri)
    for run in (seen.parent, *seen.children.values()):  # none is known to be complete
        seen.client.delete_tag(run.info.run_id, CONTENT)
    rewind(run_dir)
    assert publish(run_dir, uri, finished=True).ok
    assert {table: rows(uri, table) for table in before} == before


def test_changed_scores_replace_the_old_ones(run_dir: Path, uri: str) -> None:
    publish(run_dir, uri, finished=True)
    report(run_dir, make_episodes().assign(accomplished=0, score=0.0))
    assert publish(run_dir, uri, finished=True).ok
    seen = Seen(uri)
    assert seen.parent.data.metrics["table1/2 goals/no-stitch/score"] == 0
    assert seen.children["no-stitch", 0].data.metrics["table1/2 goals/score"] == 0
    curve = seen.client.get_metric_history(
        seen.children["no-stitch", 0].info.run_id, "agent/value_loss"
    )
    assert len(curve) == 5


def test_changed_params_make_a_new_run(run_dir: Path, uri: str) -> None:
    publish(run_dir, uri, finished=True)
    write_json(run_dir / "spec.json", make_spec() | {"spec": {"episodes": 3}})
    assert publish(run_dir, uri, finished=True).ok
    seen = Seen(uri)
    assert seen.count == 1 + CHILDREN
    assert seen.parent.data.params["episodes"] == "3"


def test_unchanged_content_is_skipped_without_importing_mlflow(run_dir: Path, uri: str) -> None:
    assert publish(run_dir, uri, finished=True).ok
    assert not pending(run_dir, uri)
    code = (
        "import sys; from pathlib import Path; from orchestrator import tracking\n"
        f"run, uri = Path({str(run_dir)!r}), {uri!r}\n"
        "assert not tracking.pending(run, uri)\n"
        "assert tracking.publish(run, uri, finished=False).skipped\n"
        "assert tracking.publish(run, uri, finished=True).skipped\n"
        "assert 'mlflow' not in sys.modules and 'pandas' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
    assert Seen(uri).states()[0] == "FINISHED"


def test_pending_until_published(run_dir: Path, uri: str, tmp_path: Path) -> None:
    assert pending(run_dir, uri)
    publish(run_dir, uri, finished=True)
    assert not pending(run_dir, uri)
    assert pending(run_dir, default_uri(tmp_path / "elsewhere"))
    for dated in tracking.DATED:  # which alone are no news
        (run_dir / dated).write_text((run_dir / dated).read_text() + " ")
    assert not pending(run_dir, uri)
    (run_dir / "report" / "figures" / "scores.svg").write_text("another figure")
    assert pending(run_dir, uri)
    publish(run_dir, uri, finished=True)
    Path(uri.removeprefix("sqlite:///")).unlink()
    assert pending(run_dir, uri)  # the view is gone, the truth is not


@pytest.mark.parametrize("content", ["", "{", "[]", '{"uri": "x"}'])
def test_a_damaged_receipt_counts_as_none(run_dir: Path, uri: str, content: str) -> None:
    (run_dir / "tracking.json").write_text(content)
    assert pending(run_dir, uri)


# --- Kills -------------------------------------------------------------------------------------


def test_what_a_kill_left_running_is_reconciled(run_dir: Path, uri: str) -> None:
    publish(run_dir, uri, finished=True)
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
    assert publish(run_dir, uri, finished=True).ok

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
        publish(run_dir, uri, finished=True)
    monkeypatch.undo()
    assert pending(run_dir, uri)
    assert publish(run_dir, uri, finished=True).ok
    seen = Seen(uri)
    assert seen.states() == ("FINISHED", {"FINISHED"})
    assert seen.count == rows(uri, "runs") == 1 + CHILDREN


# --- Trouble -----------------------------------------------------------------------------------


def test_a_server_that_is_down_is_said_in_one_line(run_dir: Path) -> None:
    with closing(socket.socket()) as listener:
        listener.bind(("127.0.0.1", 0))
        port = listener.getsockname()[1]
    uri = f"http://user:secret@127.0.0.1:{port}"
    start = time.monotonic()
    outcome = publish(run_dir, uri, finished=True)
    assert time.monotonic() - start < 15
    assert not outcome.ok
    assert "\n" not in outcome.error
    assert f"127.0.0.1:{port}" in outcome.error
    assert "secret" not in outcome.error + (run_dir / "tracking.json").read_text()
    assert pending(run_dir, uri)


@contextmanager
def locked(database: Path) -> Iterator[None]:
    """Another process holds the database."""
    code = (
        "import sqlite3, sys\n"
        f"connection = sqlite3.connect({str(database)!r})\n"
        "connection.execute('BEGIN EXCLUSIVE')\n"
        "print('locked', flush=True); sys.stdin.read()"
    )
    pipe = subprocess.PIPE
    with subprocess.Popen([sys.executable, "-c", code], stdin=pipe, stdout=pipe) as holder:
        assert holder.stdout is not None
        assert holder.stdout.readline() == b"locked\n"
        yield
        holder.communicate()


def test_a_locked_database_is_said_and_made_up_for_later(
    run_dir: Path, uri: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tracking, "LOCK_SECONDS", 1.0)
    with locked(Path(uri.removeprefix("sqlite:///"))):
        start = time.monotonic()
        outcome = publish(run_dir, uri, finished=True)
        assert time.monotonic() - start < 5
        assert not outcome.ok
        assert "locked" in outcome.error
        assert pending(run_dir, uri)
    assert publish(run_dir, uri, finished=True).ok
    assert not pending(run_dir, uri)


@pytest.mark.parametrize("uri", ["nonsense://x", "sqlite:////proc/nowhere/mlflow.db"])
def test_a_store_that_cannot_be_is_no_reason_to_stop(run_dir: Path, uri: str) -> None:
    outcome = publish(run_dir, uri, finished=True)
    assert not outcome.ok
    assert outcome.error
    assert not tracking.prepare(uri).ok or uri.startswith("nonsense")


def test_a_deleted_experiment_is_named(run_dir: Path, uri: str) -> None:
    publish(run_dir, uri, finished=True)
    seen = Seen(uri)
    seen.client.delete_experiment(seen.experiment)
    rewind(run_dir)
    assert "skillstitch/maze was deleted" in publish(run_dir, uri, finished=True).error


def test_a_slow_store_gets_the_rest_next_time(
    run_dir: Path, uri: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tracking, "PUBLISH_SECONDS", 0.0)
    assert "more than" in publish(run_dir, uri, finished=True).error
    monkeypatch.undo()
    assert publish(run_dir, uri, finished=True).ok
    assert Seen(uri).count == 1 + CHILDREN


# --- Several at once ---------------------------------------------------------------------------


def spawn(run_dir: Path, uri: str) -> subprocess.Popen:
    code = (
        "from pathlib import Path; from orchestrator.tracking import publish\n"
        f"outcome = publish(Path({str(run_dir)!r}), {uri!r}, finished=True)\n"
        "assert outcome.ok, outcome.error"
    )
    return subprocess.Popen([sys.executable, "-c", code])


def test_runs_that_publish_to_one_new_store_at_the_same_time(tmp_path: Path) -> None:
    runs = {
        name: finish_run(train_run(start_run(tmp_path / name, run_id=name)))
        for name in ("one", "two")
    }
    uri = default_uri(tmp_path)  # nobody has created the schema yet
    processes = [spawn(run_dir, uri) for run_dir in runs.values()]
    assert [process.wait() for process in processes] == [0, 0]
    for name in runs:
        assert Seen(uri, run_id=name).states() == ("FINISHED", {"FINISHED"})


def test_a_schema_that_a_background_thread_creates(run_dir: Path, tmp_path: Path) -> None:
    (tmp_path / "mlflow.db.new").write_bytes(b"what a kill left of an earlier attempt")
    uri = default_uri(tmp_path)
    thread = threading.Thread(target=tracking.prepare, args=(uri,))
    thread.start()
    assert publish(run_dir, uri, finished=True).ok
    thread.join()
    assert Seen(uri).states() == ("FINISHED", {"FINISHED"})
    assert not (tmp_path / "mlflow.db.new").exists()


# --- A real server -----------------------------------------------------------------------------


@pytest.fixture
def server(fresh_store: Path, tmp_path: Path) -> Iterator[str]:
    shutil.copy(fresh_store, tmp_path / "mlflow.db")
    with closing(socket.socket()) as listener:
        listener.bind(("127.0.0.1", 0))
        port = listener.getsockname()[1]
    command = [sys.executable, "-m", "mlflow", "server", "--host", "127.0.0.1", "--workers", "1"]
    command += ["--port", str(port), "--backend-store-uri", default_uri(tmp_path)]
    command += ["--artifacts-destination", str(tmp_path / "served")]
    quiet = {"MLFLOW_SERVER_ENABLE_JOB_EXECUTION": "false", **tracking.SETTINGS}
    with (tmp_path / "server.log").open("w") as log:
        process = subprocess.Popen(command, env=os.environ | quiet, stdout=log, stderr=log)
    try:
        wait_until(lambda: answers(f"http://127.0.0.1:{port}/health"), seconds=120)
        yield f"http://127.0.0.1:{port}"
    finally:
        process.terminate()
        process.wait()


def wait_until(condition: Callable[[], bool], seconds: float) -> None:
    deadline = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.2)


def answers(url: str) -> bool:
    try:
        with urllib.request.urlopen(url, timeout=2) as response:
            return response.status == 200
    except OSError:
        return False


@pytest.mark.slow
def test_publishing_to_a_server(run_dir: Path, server: str) -> None:
    assert publish(run_dir, server, finished=False).ok
    assert publish(run_dir, server, finished=True).ok
    seen = Seen(server)
    assert seen.states() == ("FINISHED", {"FINISHED"})
    assert len(seen.children) == CHILDREN
    artifacts = {file.path for file in seen.client.list_artifacts(seen.parent.info.run_id)}
    assert artifacts == {"spec.json", "provenance.json", "report"}
    assert publish(run_dir, server, finished=True).skipped

"""What MLflow shows of a run directory."""

import re
from pathlib import Path

import pytest

from orchestrator.tracking import PublishOutcome, publish
from orchestrator.tracking.metrics import learning_curves
from orchestrator.tracking.names import LONGEST_TEXT, metric_name
from tests.orchestrator.tracking.fake_run import (
    CHILDREN,
    Seen,
    finish_run,
    make_episodes,
    make_spec,
    start_run,
    train_run,
    write_json,
)


def test_a_finished_run_is_shown_whole(run_dir: Path, uri: str) -> None:
    assert publish(run_dir, uri, "FINISHED") == PublishOutcome(ok=True)
    seen = Seen(uri)
    assert seen.states() == ("FINISHED", {"FINISHED"})
    assert len(seen.children) == CHILDREN

    parent = seen.parent.data
    assert seen.parent.info.run_name == "table1 · smoke · abc1"
    assert parent.tags["mlflow.source.git.commit"] == "f00d"
    assert parent.tags["version.torch"] == "2.13.0"
    assert parent.tags["skillstitch.scale"] == "smoke"
    assert parent.params["mb_stitch.cem.population"] == "50"
    assert parent.metrics["seconds/training"] == 12.5
    assert parent.metrics["busy_worker_seconds/evaluation"] == 55.5
    assert parent.metrics["counts/episodes"] == 432
    assert {
        "table1/2_goals/mf-stitch/score",
        "table1/3_goals/mf-stitch/ci_low",
        "table1/2_goals/mb-stitch_alpha_2.5/ci_high",
        "table1/2_goals/mb-stitch_alpha_2.5_over_no-stitch/gain",
    } <= parent.metrics.keys()

    assert seen.parent.inputs is not None
    (dataset,) = seen.parent.inputs.dataset_inputs
    assert dataset.dataset.name == "demonstrations"
    artifacts = {file.path for file in seen.client.list_artifacts(seen.parent.info.run_id)}
    assert artifacts == {"spec.json", "provenance.json", "report"}
    folder = Path(uri.removeprefix("sqlite:///")).parent / "mlartifacts"
    assert [path.name for path in folder.rglob("*.svg")] == ["scores.svg"]


def test_children_show_their_own_scores_and_curves(run_dir: Path, uri: str) -> None:
    publish(run_dir, uri, "FINISHED")
    seen = Seen(uri)
    episodes = make_episodes()
    means = episodes[episodes["length"] == 2].groupby(["method", "seed"])["score"].mean()
    for own, run in seen.children.items():
        assert run.data.tags["mlflow.parentRunId"] == seen.parent.info.run_id
        names = (f"table1/2_goals/{column}" for column in ("ci_low", "score", "ci_high"))
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


def test_runs_can_be_sorted_by_one_score(run_dir: Path, uri: str) -> None:
    """Over all tasks, whatever their lengths and whatever tables there are."""
    publish(run_dir, uri, "FINISHED")
    seen = Seen(uri)
    means = make_episodes().groupby(["method", "seed"])["score"].mean()
    for own, run in seen.children.items():
        assert run.data.metrics["score"] == pytest.approx(means[own])
    scores = [
        run.data.metrics["score"]
        for run in seen.client.search_runs(
            [seen.experiment], "metrics.score >= 0", order_by=["metrics.score DESC"]
        )
    ]
    assert scores == sorted(scores, reverse=True)
    assert len(scores) == CHILDREN


def test_every_child_names_what_it_learned_from(run_dir: Path, uri: str) -> None:
    publish(run_dir, uri, "FINISHED")
    for run in Seen(uri).children.values():
        assert run.inputs is not None
        (shown,) = run.inputs.dataset_inputs
        assert (shown.dataset.name, shown.dataset.digest) == ("demonstrations", "e" * 36)


def test_names_of_metrics_have_no_spaces(run_dir: Path, uri: str) -> None:
    publish(run_dir, uri, "FINISHED")
    seen = Seen(uri)
    for run in (seen.parent, *seen.children.values()):
        assert run.data.metrics
        assert all(re.fullmatch(r"[\w./-]+", name) for name in run.data.metrics)
    assert metric_name("table2/mic → lig/reach-stitch[a=1] over no-stitch: x/gain") == (
        "table2/mic_to_lig/reach-stitch_a_1_over_no-stitch_x/gain"
    )


def test_the_life_of_a_run(tmp_path: Path, uri: str) -> None:
    run_dir = start_run(tmp_path / "run")
    assert publish(run_dir, uri, "RUNNING").ok
    begun = Seen(uri)
    assert begun.states() == ("RUNNING", set())
    assert begun.parent.data.metrics == {}

    train_run(run_dir)
    assert publish(run_dir, uri, "RUNNING").ok
    first = Seen(uri)
    assert first.states() == ("RUNNING", {"RUNNING"})

    finish_run(run_dir)
    assert publish(run_dir, uri, "FINISHED").ok
    last = Seen(uri)
    assert last.states() == ("FINISHED", {"FINISHED"})
    assert begun.parent.info.run_id == first.parent.info.run_id == last.parent.info.run_id
    assert last.parent.data.metrics["seconds/training"] == 12.5
    assert last.children.keys() == first.children.keys()


def test_a_failed_run(tmp_path: Path, uri: str) -> None:
    run_dir = train_run(start_run(tmp_path / "run"))
    assert publish(run_dir, uri, "FAILED").ok
    assert Seen(uri).states() == ("FAILED", {"FAILED"})
    assert publish(run_dir, uri, "RUNNING").ok  # the same command again, which resumes
    assert Seen(uri).states() == ("RUNNING", {"RUNNING"})


def test_long_configurations_fit_into_params(tmp_path: Path, uri: str) -> None:
    run_dir = start_run(tmp_path / "run")
    long = {"notes": "x" * 9000, "many": {str(i): i for i in range(150)}}
    write_json(run_dir / "spec.json", make_spec() | {"spec": long})
    assert publish(run_dir, uri, "RUNNING").ok
    params = Seen(uri).parent.data.params
    assert len(params["notes"]) == LONGEST_TEXT
    assert params["many.149"] == "149"


def test_several_artifacts_of_a_kind_keep_their_curves_apart() -> None:
    training = [
        {"kind": "agent", "seed": 0, "key": key, "curves": {"loss": [[1, 2.0], [2, float("nan")]]}}
        for key in ("aaaaaaaaaa", "bbbbbbbbbb")
    ]
    curves = learning_curves("no-stitch", ["agent"], 0, training)
    assert curves == {"agent_aaaaaaaa/loss": [(1, 2.0)], "agent_bbbbbbbb/loss": [(1, 2.0)]}

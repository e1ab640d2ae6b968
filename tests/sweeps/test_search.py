"""Trials share what they do not touch, and hopeless ones are given up."""

import json
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from orchestrator.errors import UsageError
from orchestrator.spec.spec import load_spec
from sweeps.candidates import group, method_of
from sweeps.search import rounds, search_spec
from sweeps.space import Dimension, Fields
from sweeps.spec import Confirm, Pruner, base_spec
from sweeps.study import SweepStudy, result_of
from sweeps.winner import with_winner
from tests.orchestrator.tiny import Counted, Place
from tests.sweeps.tiny import sweep_in, tiny_sweep

ALPHA, POPULATION = "mb_stitch.alpha", "mb_stitch.random_shooting.population"
UNCONFIRMED = Confirm(best=0)


def counts(root: Path) -> dict[str, Any]:
    return json.loads((root / "sweep" / "counts.json").read_text())


def trials(root: Path) -> list[dict[str, Any]]:
    return json.loads((root / "sweep" / "trials.json").read_text())


def test_no_first_skill_and_no_no_stitch_segment_is_played_again(done: Path) -> None:
    """Another sweep over the same store trains nothing and plays its own stitches alone."""
    shutil.rmtree(done / "sweep")
    sweep_in(done, tiny_sweep(seed=1))
    found = counts(done)
    assert found["artifacts trained"] == {}
    assert set(found["blocks played"]) == {"mb-stitch"}


def test_the_report_counts_what_the_confirmation_took(finished: Path) -> None:
    played = counts(finished)["blocks played"]
    page = (finished / "sweep" / "report" / "index.html").read_text()
    assert "blocks played: " + ", ".join(f"{kind} {n}" for kind, n in played.items()) in page


def test_a_search_keeps_its_report(finished: Path) -> None:
    kept = finished / "results" / tiny_sweep().name
    assert {"index.md", "trials.csv", "confirm.csv", "provenance.json"} <= {
        path.name for path in kept.iterdir()
    }
    report = finished / "sweep" / "report" / "index.md"
    assert (kept / "index.md").read_bytes() == report.read_bytes()


def test_every_block_is_played_once(trained: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    executor = Counted()
    monkeypatch.setattr("orchestrator.reproduction.open_executor", lambda *_: executor)
    sweep_in(trained, tiny_sweep())
    assert set(executor.played.values()) == {1}
    assert not executor.built
    found = counts(trained)["blocks played"]
    assert sum(found.values()) == len(executor.played)
    # Two chunks of the search's seed: first skills of g0, g1; then of g2, g3 by the new seed.
    assert found["first skills, shared"] == 2 * 2 + 2 * 2
    assert found["no-stitch"] <= 2 * 4 + 2 * 2


def test_the_first_trial_is_the_base_s_own_setting(finished: Path) -> None:
    assert trials(finished)[0]["fields"] == {ALPHA: 10.0, "mb_stitch.beta": 1.0, POPULATION: 16}


def test_a_trial_s_gain_is_that_of_the_same_run(finished: Path, tmp_path: Path) -> None:
    """The winner's own table, played by `skillstitch run`, says the same."""
    place = Place(tmp_path)
    shutil.copytree(finished / "store", place.store_root)
    spec = with_winner(search_spec(tiny_sweep()), str(finished / "sweep"))
    before = place.shared().finished()
    place.carry_out(replace(spec, tables=()))
    assert place.shared().finished() == before, "every block was there"
    scores = pd.read_parquet(place.out / "episodes.parquet").groupby("method")["score"].mean()
    winner = json.loads((finished / "sweep" / "winner.json").read_text())
    gain = scores["mb-stitch"] - scores["no-stitch"]
    assert np.isclose(gain, winner["search"]["gain"])


def test_candidates_that_share_models_are_one_spec() -> None:
    base = base_spec(tiny_sweep())
    fields: list[Fields] = [{ALPHA: 1.0}, {ALPHA: 1}, {"agent.updates": 30, ALPHA: 1.0}, {}]
    first, second = group(fields, base, "test")
    assert first.spec.methods == ("no-stitch", "mb-stitch[alpha=1]", "mb-stitch")
    assert first.methods == {0: "mb-stitch[alpha=1]", 1: "mb-stitch[alpha=1]", 3: "mb-stitch"}
    assert second.spec.methods == ("mb-stitch[alpha=1]",)
    assert second.spec.agent.updates == 30


@pytest.mark.parametrize("value", [1e-05, 0.1, 123456.75, 3.141592653589793, 1e6])
def test_a_method_names_its_numbers_in_full(value: float) -> None:
    method = method_of({ALPHA: value})
    config: Any = load_spec("table1").method_settings(method)
    assert config.alpha == value


def test_training_fields_retrain_what_they_touch_and_no_more(trained: Path) -> None:
    space = {"dynamics.updates": Dimension(choices=(60, 30)), ALPHA: Dimension(choices=(1, 10))}
    sweep_in(trained, tiny_sweep(sampler="grid", space=space, confirm=UNCONFIRMED))
    assert counts(trained)["artifacts trained"] == {"dynamics": 1}
    assert counts(trained)["blocks played"]["first skills, shared"] == 2 * 2
    assert len(trials(trained)) == 4


def test_several_objectives_and_constraints(trained: Path) -> None:
    sweep = tiny_sweep(
        objectives=("gain", "imagined"), constraints={"imagined": 50.0}, confirm=UNCONFIRMED
    )
    directory = sweep_in(trained, sweep)
    found = trials(trained)
    assert [t["feasible"] for t in found] == [t["imagined"] <= 50 for t in found]
    assert {t["feasible"] for t in found} == {True, False}
    winner = json.loads((directory.path / "winner.json").read_text())
    best = max(t["gain"] for t in found if t["feasible"])
    assert winner["search"]["gain"] == best
    assert "## Pareto front" in (directory.path / "report" / "index.md").read_text()


def test_constraints_that_no_trial_keeps_to_are_an_error(trained: Path) -> None:
    with pytest.raises(UsageError, match="no trial is finished that keeps to the constraints"):
        sweep_in(trained, tiny_sweep(constraints={"imagined": 0.0}, confirm=UNCONFIRMED, trials=2))


def test_rounds_grow_by_blocks_or_else_by_tasks() -> None:
    spec = search_spec(tiny_sweep())  # 4 tasks, 6 episodes in blocks of 4
    assert [part.episodes for part in rounds(spec, 2)] == [4, 6]
    assert [len(part.tasks) for part in rounds(spec, 3)] == [2, 3, 4]
    assert rounds(spec, 4)[-1] == spec
    assert rounds(spec, 1) == [spec]


def test_rounds_of_tasks_keep_families_together() -> None:
    settings = {"tasks": [], "lengths": [2, 3], "block_episodes": 6}
    sweep = tiny_sweep(tasks=(), held_out=(), settings=settings, pruner=Pruner(rounds=12))
    families = [task.split(">")[:2] for task in search_spec(sweep).tasks]
    assert families == [family for family in families[::3] for _ in range(3)]
    assert len(rounds(search_spec(sweep), 12)) == 12


def test_hopeless_trials_are_given_up_and_are_never_the_best(trained: Path) -> None:
    sweep = tiny_sweep(pruner=Pruner(rounds=4, p=0.45, startup=2), trials=12)
    sweep_in(trained, sweep)
    found = trials(trained)
    given_up = [trial for trial in found if trial["pruned"]]
    assert given_up
    assert all(trial["rounds"] < 4 for trial in given_up)
    winner = json.loads((trained / "sweep" / "winner.json").read_text())
    assert not winner["search"]["pruned"]
    assert not set(range(sweep.batch)) & {trial["trial"] for trial in given_up}, "nothing to judge"


def test_a_given_up_trial_is_told_as_what_it_would_be_on_all_tasks(trained: Path) -> None:
    """Its tasks may have been easy ones: it is as far from the best trial's gain as on these."""
    sweep = tiny_sweep(pruner=Pruner(rounds=4, p=0.45, startup=2), trials=12)
    sweep_in(trained, sweep)
    told = SweepStudy(sweep, trained / "sweep").trials
    found = [result_of(trial) for trial in told]
    given_up = [number for number, result in enumerate(found) if result["pruned"]]
    for number in given_up:
        before = found[: number - number % sweep.batch]  # what was known when its batch was judged
        best = max((one for one in before if not one["pruned"]), key=lambda one: one["gain"])
        behind = [gain - best["tasks"][task] for task, gain in found[number]["tasks"].items()]
        assert 0 < len(behind) < len(best["tasks"])
        assert told[number].values == [pytest.approx(best["gain"] + np.mean(behind))]
    assert given_up


def test_confirmation_is_on_unseen_tasks_and_seeds(finished: Path) -> None:
    confirmed = json.loads((finished / "sweep" / "confirm.json").read_text())
    sweep = tiny_sweep()
    assert confirmed["tasks"] == list(sweep.held_out)
    assert confirmed["seeds"] == [1]
    winner = json.loads((finished / "sweep" / "winner.json").read_text())
    assert confirmed["trials"][0] == winner["confirmed"]
    assert confirmed["trials"][0]["trial"] == winner["trial"]
    for row in confirmed["trials"]:
        assert row["over_base_low"] <= row["over_base"] <= row["over_base_high"]
        assert row["pairs"] == 2 * 6

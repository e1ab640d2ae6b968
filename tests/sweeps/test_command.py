"""The commands a user types, and what is written for them."""

import json
import shlex
import shutil
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any
from unittest import mock

import pandas as pd
import pytest

from analysis.results import extent_of, provenance_text
from orchestrator.cli import main
from orchestrator.errors import LockedError, UsageError
from orchestrator.spec.spec import TableSpec
from orchestrator.storage import locking
from orchestrator.storage.rundir import RunDirectory
from orchestrator.work.progress import Silent
from sweeps import winner as winners
from sweeps.candidates import method_of
from sweeps.results.alpha_beta import paper_gains
from sweeps.results.figures import draw_figures
from sweeps.scoring import pareto_front
from sweeps.search import run_search
from sweeps.space import Dimension
from sweeps.spec import Confirm, load_sweep
from sweeps.study import SweepStudy
from sweeps.sweep import carry_out
from tests.orchestrator.launched import statuses
from tests.orchestrator.tiny import TINY, Lines, Place
from tests.sweeps.tiny import TINY_SWEEP, settings, sweep_in, tiny_sweep

ALPHA, BETA = "mb_stitch.alpha", "mb_stitch.beta"
GRID = {ALPHA: Dimension(choices=(1, 10)), BETA: Dimension(choices=(1, 20))}


def command(root: Path, *more: str) -> list[str]:
    places = ["--out", root / "sweep", "--store", root / "store", "--results", root / "results"]
    how = ["--executor", "serial", "--tracking-uri", "none"]
    return ["sweep", *map(str, [TINY_SWEEP, *places, *how, *more])]


def test_what_a_user_sees(done: Path, capsys: pytest.CaptureFixture[str]) -> None:
    main(command(done))
    out, err = capsys.readouterr()
    assert "10 trials × 4 tasks × 1 seed × 6 episodes, 3 trials at once" in err
    assert "4 of 4 artifacts, 4 of 4 blocks of first skills, 8 of 8 blocks of No-Stitch" in err
    assert "trials: 10 of 10 already there" in err
    assert "## Winner" in out
    assert "Judged again on 2 held-out tasks by new seeds (1; root seed 0)" in out
    assert "Over the base's own setting it gains **" in out
    assert f"report: {done / 'sweep' / 'report' / 'index.html'}" in out
    figures = {path.name for path in (done / "sweep" / "report" / "figures").glob("*.svg")}
    assert figures == {"history.svg", "importances.svg", "slices.svg", "alpha-beta.svg"}


def test_a_report_is_written_again(done: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """From the study alone: nothing is played, and the bytes are those of the sweep's own."""
    sweep, results = done / "sweep", done / "results"
    main(command(done))
    capsys.readouterr()
    before = {path.name: path.read_bytes() for path in (sweep / "report").glob("*.*")}
    shutil.rmtree(sweep / "report")
    (sweep / "trials.json").unlink()
    shutil.rmtree(results)
    main(["report", str(sweep), "--results", str(results)])
    assert capsys.readouterr().out == f"wrote {sweep / 'report' / 'index.html'}\n"
    assert {path.name: path.read_bytes() for path in (sweep / "report").glob("*.*")} == before
    (exported,) = results.iterdir()
    assert (exported / "index.md").read_bytes() == before["index.md"]


def test_a_report_of_a_sweep_without_a_finished_trial_says_so(
    done: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (done / "sweep" / "study.journal").unlink()
    with pytest.raises(SystemExit) as end:
        main(["report", str(done / "sweep")])
    assert end.value.code == UsageError.exit_code
    assert "no trial" in capsys.readouterr().err


def test_nothing_is_exported_unless_it_is_asked_for(
    done: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Else a small sweep would replace the results that are kept of a large one."""
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")
    words = command(done)
    place = words.index("--results")
    main([*words[:place], *words[place + 2 :]])
    assert list(Path().iterdir()) == []


def test_results_of_a_larger_sweep_stay(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = tmp_path / "results" / tiny_sweep().name
    folder.mkdir(parents=True)
    kept = provenance_text({}, {"trials": 99})
    (folder / "provenance.json").write_text(kept)
    with pytest.raises(SystemExit) as refused:
        main(command(tmp_path))
    assert refused.value.code == 2
    assert "trials 99 against 10" in capsys.readouterr().err
    assert (folder / "provenance.json").read_text() == kept
    assert not (tmp_path / "sweep").exists()


def test_an_export_says_how_much_a_sweep_is(done: Path) -> None:
    sweep = tiny_sweep()
    main(command(done))
    extent = extent_of(done / "results" / sweep.name)
    assert extent == sweep.extent
    assert extent["trials"] == 10
    (done / "results" / sweep.name / "provenance.json").write_text(
        provenance_text({}, extent | {"trials": 99})
    )
    main(command(done, "--force"))
    assert extent_of(done / "results" / sweep.name) == extent


def test_a_sweep_knows_its_store_and_uses_it_beside_others(
    done: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    searched: list[str] = []

    def search(*arguments: Any) -> Iterator[None]:
        with pytest.raises(LockedError), locking.alone(done / "store"):
            raise AssertionError("somebody could have deleted what the sweep has made")
        searched.append("once")
        return run_search(*arguments)

    monkeypatch.setattr("sweeps.sweep.run_search", search)
    main(command(done))
    assert searched == ["once"]
    assert RunDirectory(done / "sweep").store_root == (done / "store").resolve()


def test_a_path_may_have_characters_that_mean_something_in_addresses(
    trained: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Search, status, list, report and export; and nothing is written elsewhere."""
    root = tmp_path / "here" / "a #b?c=1&d %41"
    shutil.copytree(trained / "store", root / "store")
    with mock.patch("sweeps.results.report.draw_figures", return_value=[]):
        main(command(root, "--trials", "3"))
        main(["report", str(root / "sweep")])
    capsys.readouterr()
    main(["status", str(root / "sweep")])
    assert "3 of 3 finished" in capsys.readouterr().out
    main(["list", str(tmp_path / "here")])
    assert "finished, 3 of 3 trials" in capsys.readouterr().out
    assert len(SweepStudy(tiny_sweep(trials=3), root / "sweep").finished) == 3
    (root / "sweep" / "finished").unlink()
    main(["status", str(root / "sweep")])
    *_, again = capsys.readouterr().out.splitlines()
    words = shlex.split(again.partition("skillstitch ")[2])
    assert words[words.index("--out") + 1] == str(root / "sweep")
    assert {path.name for path in root.iterdir()} == {"sweep", "store", "results"}
    assert [path.name for path in root.parent.iterdir()] == [root.name]


def test_the_plan_alone_runs_nothing(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    main(command(tmp_path, "--plan", "--trials", "7"))
    out = capsys.readouterr().out
    assert "7 trials × 4 tasks" in out
    assert "0 of 4 artifacts" in out
    assert not (tmp_path / "sweep").exists()


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["sweep"], "needs a sweep: kitchen-data, kitchen-search, maze-alpha-beta, table9"),
        (["sweep", "table2"], "no sweep 'table2': neither a file nor one of kitchen-data"),
        (["run", "table1", "--from-sweep", "nothing"], "no sweep 'nothing'"),
    ],
)
def test_mistakes_are_named(
    words: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as exit_:
        main(words)
    assert exit_.value.code == 2
    assert message in capsys.readouterr().err


def test_a_run_takes_the_winner(
    done: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    fields = json.loads((done / "sweep" / "winner.json").read_text())["fields"]
    sweep, out = str(done / "sweep"), done / "run"
    places = ["--store", str(done / "store"), "--out", str(out)]
    how = ["--executor", "serial", "--tracking-uri", "none", "--methods", "no-stitch", "mb-stitch"]
    with mock.patch("analysis.report.draw_figures", return_value=[]):
        main(["run", str(TINY), "--scale", "smoke", "--from-sweep", sweep, *places, *how])
    spec = json.loads((out / "spec.json").read_text())["spec"]
    assert spec["mb_stitch"]["alpha"] == fields[ALPHA]
    population = spec["mb_stitch"]["random_shooting"]["population"]
    assert population == fields["mb_stitch.random_shooting.population"]
    assert "A tiny table" in capsys.readouterr().out
    # By its name, from where sweeps are kept; and not for another benchmark.
    monkeypatch.setattr(winners, "RUNS", done)
    shutil.copytree(done / "sweep", done / "sweep-mine-quick")
    assert winners.find_sweep("mine") == done / "sweep-mine-quick"
    with pytest.raises(SystemExit):
        main(["plan", "table2", "--from-sweep", "mine", "--store", str(done / "store")])
    assert "searched maze; table2 is of kitchen" in capsys.readouterr().err


def test_a_sweep_without_a_winner_says_so(done: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (done / "sweep" / "winner.json").unlink()
    with pytest.raises(SystemExit):
        main(["plan", "table1", "--from-sweep", str(done / "sweep")])
    assert "has no winner yet" in capsys.readouterr().err


def test_a_grid_is_tabled_like_any_other_run(trained: Path) -> None:
    table = TableSpec("grid", paper="9", rows="task", baseline="no-stitch", title="A grid")
    sweep = tiny_sweep(sampler="grid", space=GRID, confirm=Confirm(best=0), tables=(table,))
    with mock.patch("analysis.report.draw_figures", return_value=[]):
        directory = carry_out(sweep, settings(trained), Silent(), trained / "results")
    folder = trained / "results" / "grid"
    written = {path.name for path in folder.iterdir()}
    assert written == {
        "scores.csv", "gains.csv", "table.md", "table.tex", "provenance.json", "figures",
        "spec.json", "segments.parquet", "quarantine.json", "seeds.csv",
    }  # fmt: skip
    heat_maps = {path.name for path in (folder / "figures").glob("*.svg")}
    assert {"sweep-alpha-beta.svg", "sweep-alpha-beta-tasks.svg"} <= heat_maps
    scores = pd.read_csv(folder / "scores.csv")
    assert list(scores["method"].unique()) == [
        "no-stitch",
        *(f"mb-stitch[alpha={alpha},beta={beta}]" for alpha in (1, 10) for beta in (1, 20)),
    ]
    gains = pd.read_csv(folder / "gains.csv")
    assert set(gains["baseline"]) == {"no-stitch"}
    # The table's gains, mean over its tasks, are the trials' own.
    for trial in directory.read_json("trials.json"):
        own = gains.loc[gains["method"] == trial["method"], "gain"].mean()
        assert own == pytest.approx(trial["gain"], abs=1e-6)


def test_the_base_s_own_setting_is_a_point_like_any_other(trained: Path) -> None:
    """(10, 1) is the base's; the table names it as the paper does."""
    sweep = tiny_sweep(
        sampler="grid",
        space={ALPHA: Dimension(choices=(10,)), BETA: Dimension(choices=(1,))},
        confirm=Confirm(best=1),
    )
    found = sweep_in(trained, sweep).read_json("confirm.json")
    assert found["trials"][0]["over_base"] == 0


def test_every_figure_can_be_drawn(tmp_path: Path) -> None:
    trial = {
        "trial": 0, "fields": {ALPHA: 1, BETA: 1}, "pruned": False, "feasible": True, "gain": 0.1,
        "gain_low": 0.0, "method": "mb-stitch", "gain_high": 0.2, "imagined": 10.0,
        "tasks": {"a>b": 0.1, "b>a": 0.1},
    }  # fmt: skip
    other = trial | {"trial": 1, "fields": {ALPHA: 10, BETA: 20}, "gain": 0.3, "imagined": 20.0}
    worse = trial | {"trial": 2, "pruned": True, "imagined": 30.0}
    sweep = tiny_sweep(sampler="grid", space=GRID, objectives=("gain", "imagined"))
    drawn = draw_figures(sweep, [trial, other, worse], {ALPHA: 0.7, BETA: 0.3}, tmp_path)
    assert [figure.name for figure in drawn] == [
        "history", "importances", "slices", "pareto", "alpha-beta", "alpha-beta-tasks",
    ]  # fmt: skip
    assert [one["trial"] for one in pareto_front([trial, other, worse])] == [0, 1]


def test_table9_s_heat_maps_stand_above_the_paper_s() -> None:
    sweep = load_sweep("table9")
    trials = [{"method": method_of(point)} for point in sweep.points]
    rows = ["kettle → top burner", "a task that the paper does not have"]
    gains = paper_gains(sweep, trials, rows)
    assert list(gains) == ["the paper's:\nkettle → top burner"]
    assert next(iter(gains.values()))[0] == pytest.approx(0.358 - 0.222)  # α = β = 1


def test_garbage_collection_keeps_what_a_sweep_needs(
    done: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    main(["gc", str(done / "sweep"), "--store", str(done / "store")])
    assert "would delete 0 blocks; artifacts freed 0.0 MB" in capsys.readouterr().out


def test_mlflow_shows_the_sweep_and_each_trial_once(done: Path) -> None:
    pytest.importorskip("mlflow")
    from mlflow import MlflowClient

    uri = f"sqlite:///{done / 'mlflow.db'}"
    for _ in range(2):
        sweep_in(done, tiny_sweep(), tracking_uri=uri)
    client = MlflowClient(tracking_uri=uri)
    experiment = client.get_experiment_by_name("skillstitch/maze")
    assert experiment is not None
    runs = client.search_runs([experiment.experiment_id])
    run_id = json.loads((done / "sweep" / "identity.json").read_text())["run_id"]
    parents = [run for run in runs if "mlflow.parentRunId" not in run.data.tags]
    assert [run.info.run_name for run in parents] == [f"sweep tiny-sweep · paper · {run_id[:4]}"]
    children = [run for run in runs if "mlflow.parentRunId" in run.data.tags]
    assert sorted(run.info.run_name for run in children) == sorted(
        f"trial {n} · {run_id[:4]}" for n in range(10)
    )
    assert {run.info.status for run in runs} == {"FINISHED"}
    told = json.loads((done / "sweep" / "trials.json").read_text())
    gains = {int(run.info.run_name.split()[1]): run.data.metrics["gain"] for run in children}
    assert gains == {trial["trial"]: trial["gain"] for trial in told}


def test_mlflow_shows_an_interrupted_sweep_as_killed(
    done: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("mlflow")
    uri = f"sqlite:///{done / 'mlflow.db'}"

    def interrupted(*_: object, **__: object) -> None:
        deadline = time.monotonic() + 60
        while "RUNNING" not in statuses(Place(done)):
            assert time.monotonic() < deadline
            time.sleep(0.05)
        raise KeyboardInterrupt

    monkeypatch.setattr("sweeps.sweep.write_report", interrupted)
    with pytest.raises(KeyboardInterrupt):
        sweep_in(done, tiny_sweep(), tracking_uri=uri)
    assert "KILLED" in statuses(Place(done))
    assert "RUNNING" not in statuses(Place(done))
    monkeypatch.undo()
    sweep_in(done, tiny_sweep(), tracking_uri=uri)
    assert set(statuses(Place(done))) == {"FINISHED"}


def test_tracking_that_fails_never_stops_the_search(done: Path) -> None:
    lines = Lines()
    (done / "mlflow.db").mkdir()
    sweep_in(done, replace(tiny_sweep()), lines, tracking_uri=f"sqlite:///{done / 'mlflow.db'}")
    assert "tracking: " in lines.text
    assert "the next command publishes what was missed" in lines.text

"""`skillstitch status` and `list` of a sweep."""

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from orchestrator.cli import main
from orchestrator.storage.rundir import RunDirectory
from sweeps.journal import JOURNAL, entries
from sweeps.results.status import ASKED, TOLD, state, state_of
from sweeps.space import Dimension
from sweeps.spec import Confirm
from sweeps.study import SweepStudy
from tests.sweeps.tiny import TINY_SWEEP, sweep_in, tiny_sweep


def told(folder: Path, capsys: pytest.CaptureFixture[str]) -> dict[str, str]:
    """What `status` says, by the word that begins a line."""
    main(["status", str(folder)])
    head, *lines = capsys.readouterr().out.splitlines()
    return {"head": head} | {line[2:13].strip(): line[13:] for line in lines}


def stopped(folder: Path, finished: int) -> None:
    """As a kill leaves a sweep: some trials are told, the others of the batch are asked."""
    (folder / "finished").unlink()
    kept, ends = [], 0
    for entry in entries(folder / JOURNAL):
        ends += entry["op_code"] == TOLD
        if ends == finished and entry["op_code"] in (TOLD, ASKED):
            kept.append(entry)
            if entry["op_code"] == ASKED:
                break
        elif ends < finished:
            kept.append(entry)
    (folder / JOURNAL).write_text("".join(f"{json.dumps(entry)}\n" for entry in kept))
    trials = json.loads((folder / "trials.json").read_text())
    (folder / "trials.json").write_text(json.dumps(trials[:finished]))
    (folder / "confirm.json").unlink()


def change(folder: Path, **changes: Any) -> None:
    """Change every trial in trials.json but the first."""
    first, *others = json.loads((folder / "trials.json").read_text())
    (folder / "trials.json").write_text(json.dumps([first, *(one | changes for one in others)]))


def test_a_finished_sweep_tells_what_it_has_found(
    done: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    lines = told(done / "sweep", capsys)
    assert lines["head"].endswith("sweep: sweep tiny-sweep at paper scale")
    assert lines["artifacts"] == "4 of 4 that all trials share"
    assert lines["blocks"] == "112 played"
    assert lines["trials"] == "10 of 10 finished"
    winner = json.loads((done / "sweep" / "winner.json").read_text())
    assert lines["best"].startswith(f"trial {winner['trial']}: gain +")
    low, high = (winner["search"][f"gain_{end}"] for end in ("low", "high"))
    assert f"[{low:+.3f}, {high:+.3f}], alpha " in lines["best"]
    assert f"gain {winner['confirmed']['gain']:+.3f} [" in lines["confirmed"]
    assert lines["confirmed"].endswith("on 2 held-out tasks, by new seeds")
    assert lines["report"] == str(done / "sweep" / "report" / "index.html")
    assert lines["next"].startswith("with the winner: skillstitch run ")
    assert lines["next"].endswith(f"--from-sweep {done / 'sweep'}")


def test_one_that_was_stopped_tells_how_to_go_on(
    done: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = done / "sweep"
    stopped(folder, finished=6)
    lines = told(folder, capsys)
    assert lines["trials"] == "6 of 10 finished; 1 more asked and not finished"
    assert lines["confirmed"] == "not yet; the best 2 are played again when all trials are finished"
    again = f"skillstitch sweep {TINY_SWEEP} --scale paper --trials 10 --out {folder}"
    store = f" --store {(done / 'store').resolve()}"
    main(["list", str(done)])
    assert "unfinished, 6 of 10 trials" in capsys.readouterr().out
    (folder / "store.json").write_text(json.dumps(str(done / "store")))
    (folder / "source.json").write_text(json.dumps(str(TINY_SWEEP)))
    lines = told(folder, capsys)
    assert lines["next"] == f"unless it is at work, the same command goes on: {again}{store}"
    # Which is true.
    main([*lines["next"].split()[lines["next"].split().index("sweep") :],
          "--executor", "serial", "--tracking-uri", "none"])  # fmt: skip
    capsys.readouterr()
    assert told(folder, capsys)["trials"] == "10 of 10 finished"
    main(["list", str(done)])
    assert "finished, 10 of 10 trials" in capsys.readouterr().out


def test_trials_that_were_given_up_are_counted_and_never_the_best(
    done: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    change(done / "sweep", pruned=True, gain=9.0)
    lines = told(done / "sweep", capsys)
    assert lines["trials"] == "10 of 10 finished, 9 of them given up early"
    assert lines["best"].startswith("trial 0: ")


def test_without_a_trial_that_keeps_to_the_constraints(
    done: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    trials = json.loads((done / "sweep" / "trials.json").read_text())
    none = [trial | {"feasible": False} for trial in trials]
    (done / "sweep" / "trials.json").write_text(json.dumps(none))
    lines = told(done / "sweep", capsys)
    assert "best" not in lines
    assert lines["next"] == ("no trial keeps to the constraints: loosen them, under another --out")


@pytest.mark.parametrize("objective", ["gain", "imagined"])
def test_the_best_is_the_one_that_the_study_has(trained: Path, objective: str) -> None:
    """More of one, less of the other; the status knows no metrics."""
    sweep = tiny_sweep(trials=4, batch=4, objectives=(objective,), confirm=Confirm(best=0))
    directory = sweep_in(trained, sweep)
    best = state_of(directory).best
    assert best is not None
    assert best["trial"] == SweepStudy(sweep, directory.path).ranked()[0].number


def test_a_grid_has_as_many_trials_as_points(
    trained: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    sweep = tiny_sweep(
        sampler="grid",
        space={"mb_stitch.alpha": Dimension(choices=(1, 10))},
        confirm=Confirm(best=0),
    )
    lines = told(sweep_in(trained, sweep).path, capsys)
    assert lines["trials"] == "2 of 2 finished"
    assert lines["confirmed"].startswith("not asked for; ")


def test_one_of_an_earlier_version_is_finished_when_it_has_a_winner(done: Path) -> None:
    for name in ("finished", "source.json"):
        (done / "sweep" / name).unlink()
    assert state(RunDirectory(done / "sweep")) == "finished, 10 of 10 trials"
    (done / "sweep" / "winner.json").unlink()
    assert state(RunDirectory(done / "sweep")) == "unfinished, 10 of 10 trials"


def test_before_anything_was_played(tmp_path: Path, done: Path) -> None:
    folder = tmp_path / "begun"
    folder.mkdir()
    for name in ("spec.json", "sweep.json", "identity.json"):
        (folder / name).write_bytes((done / "sweep" / name).read_bytes())
    assert state_of(RunDirectory(folder)).best is None
    main(["status", str(folder)])


def test_status_imports_nothing_that_computes(finished: Path) -> None:
    code = f"""
import sys
from orchestrator.cli import main
main(["status", {str(finished / "sweep")!r}])
main(["list", {str(finished)!r}])
print(*sys.modules)
"""
    asked = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    loaded = set(asked.stdout.splitlines()[-1].split())
    slow = {"torch._C", "mujoco", "ray", "pandas", "mlflow", "optuna", "scipy.spatial"}
    assert not loaded & slow

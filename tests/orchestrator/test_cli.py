"""The command line: what each command says and does, and how it exits."""

import json
import re
import resource
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NoReturn
from unittest import mock

import numpy as np
import pytest

from analysis.results import provenance_text
from orchestrator.cli import COMMANDS, main
from orchestrator.errors import LockedError
from orchestrator.spec.spec import Spec
from orchestrator.storage.claim import claim_for_spec
from orchestrator.storage.store import Artifact
from orchestrator.work import playing
from orchestrator.work.jobs import Report
from orchestrator.work.plan import Plan
from stitching.methods.mb_stitch import MBStitchSettings
from stitching.rollout import Segments, play_segment
from tests.orchestrator.tiny import TINY, Counted, Place, carry_out, promised_bytes, serially
from tests.sections import section, with_sections


@dataclass(frozen=True)
class Answer:
    code: int
    out: str
    err: str


Cli = Callable[..., Answer]


@pytest.fixture
def cli(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> Iterator[Cli]:
    """A command in this process; its reports are without figures, which take seconds."""
    monkeypatch.setenv("COLUMNS", "200")

    def cli(*words: object) -> Answer:
        capsys.readouterr()
        code = 0
        try:
            main([str(word) for word in words])
        except SystemExit as end:
            code = int(end.code or 0)
        return Answer(code, *capsys.readouterr())

    with mock.patch("analysis.report.draw_figures", return_value=[]):
        yield cli


def options(place: Place) -> list[object]:
    paths = ["--out", place.out, "--store", place.store_root]
    return [TINY, *paths, "--executor", "serial", "--tracking-uri", "none"]


# Help and mistakes


def test_help(cli: Cli) -> None:
    for words in ([], ["--help"], ["-h"]):
        answer = cli(*words)
        assert answer.code == 0
        for command in COMMANDS:
            assert f"  {command} " in answer.out
        assert "table1" in answer.out


@pytest.mark.parametrize("command", COMMANDS)
def test_help_of_each_command(cli: Cli, command: str) -> None:
    answer = cli(command, "--help")
    assert answer.code == 0
    assert f"usage: skillstitch {command}" in answer.out


BASIC = (
    "--scale", "--methods", "--lengths", "--tasks", "--step-limits", "--seeds", "--episodes",
    "--out", "--store", "--workers", "--address", "--tracking-uri", "--results",
)  # fmt: skip
SETTINGS = ("--data.noise", "--agent.learning-rate", "--dynamics.width", "--mb-stitch.alpha")


@pytest.mark.parametrize("spec", [[], ["table1"]], ids=["no spec", "a spec"])
def test_every_field_of_a_spec_is_an_option(cli: Cli, spec: list[str]) -> None:
    answer = cli("run", *spec, "--help-all")
    assert answer.code == 0
    for option in (*BASIC, *SETTINGS):
        assert option in answer.out


@pytest.mark.parametrize("command", ["run", "plan"])
def test_help_says_the_basics_alone_and_where_the_rest_is(cli: Cli, command: str) -> None:
    words = [] if command == "run" else ["table3", "-h"]  # a suite, too
    basics = cli(command, *(words or ["table1", "--help"])).out
    settings = [line for line in basics.splitlines() if ".updates" in line or "--agent" in line]
    assert not settings
    assert all(option in basics for option in BASIC[:7])
    assert "--help-all shows the settings of data, models, planners and methods" in basics
    assert len(basics.splitlines()) < 80


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        (
            ["rnu"],
            "unknown command 'rnu'; there are plan, run, sweep, status, list, report",
        ),
        (["plan"], "skillstitch plan needs a spec: table1"),
        (["run", "--seeds", "3"], "skillstitch run needs a spec: table1"),
        (["plan", "table99"], "no spec 'table99': neither a file nor one of table1"),
        (
            ["plan", "table1", "--scale", "huge"],
            "no scale 'huge'; it has paper, smoke, quick, standard",
        ),
        (["plan", "table1", "--alhpa", "3"], "--alhpa"),
        (["plan", "table1", "--seeds", "many"], "--seeds"),
        (["plan", "table1", "--seeds", "0"], "seeds: must be at least 1"),
        (["plan", "table1", "--methods", "magic"], "unknown method 'magic'; there are no-stitch"),
        (
            ["plan", "table1", "--methods", "mb-stitch[alhpa=1]"],
            "valid are planner, execute, limit, alpha",
        ),
        (["plan", "table1", "--tasks", "g0>g7"], "no skill 'g7'; it has g0, g1, g2, g3"),
        (["plan", "table1", "--executor", "serial"], "--executor"),
        (["run", "table1", "--executor", "slurm"], "ray"),
        (["plan", "table1", "--data.noise", "5"], "noise: must be at most 1: 5.0"),
        (["plan", "table1", "--agent.learning-rate", "100"], "learning_rate: must be at most 1"),
        (["plan", "table1", "--agent.width", "1000000000"], "width: must be at most 16384"),
        (["plan", "table1", "--episodes", "1000000000"], "episodes: must be at most 100000"),
        (["plan", "table1", "--rollout.skill-limit", "-1"], "skill_limit: must be at least 0"),
        (["run", "table1", "--workers", "0"], "--workers must be at least 1: 0"),
        (["run", "table1", "--workers", "100000"], "give the --address of a Ray cluster"),
        (["plan", "table1", "--workers", "100000"], "give the --address of a Ray cluster"),
        (["plan", "table1", "--seeds", "1000", "--episodes", "1000"], "2,440,000 blocks"),
        (["gc"], "name the run directories to keep"),
    ],
)
def test_mistakes_are_explained(
    cli: Cli, words: list[str], complaint: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    answer = cli(*words)
    assert answer.code == 2
    assert complaint in answer.err + answer.out
    assert "Traceback" not in answer.err
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    "words", [["status"], ["report"], ["gc", "--delete"], ["compare", "."]], ids=lambda w: w[0]
)
def test_a_folder_that_is_no_run(cli: Cli, tmp_path: Path, words: list[str]) -> None:
    answer = cli(*words, tmp_path)
    assert answer.code == 2
    assert answer.err.startswith("error: ")
    assert "spec.json" in answer.err


# Plans


def counts(answer: Answer) -> dict[str, list[int]]:
    """Rows of the plan's two listings: found, missing and, for blocks, decided."""
    rows = {}
    for line in answer.out.splitlines():
        words = line.split()
        numbers = [int(word) for word in words if word.isdigit()]
        if len(numbers) in (2, 3) and words[-1].isdigit():
            rows[" ".join(words[: -len(numbers)])] = numbers
    return rows


def test_a_plan_of_nothing_yet(cli: Cli, tmp_path: Path) -> None:
    answer = cli("plan", TINY, "--store", tmp_path / "store")
    assert answer.code == 0
    assert "6 tasks × 4 methods × 2 seeds × 6 episodes = 288 episodes" in answer.out
    rows = counts(answer)
    assert rows["agent"] == rows["dynamics"] == rows["mf-policy"] == [0, 2]
    assert rows["first skills, shared"] == [0, 16, 0]
    assert rows["MB-Stitch"] == rows["No-Stitch"] == [0, 24, 0]
    assert not (tmp_path / "store").exists()


def test_a_plan_after_a_run_with_another_alpha(cli: Cli, finished: Place) -> None:
    """Artifacts and first skills are reused, and the plan says so beforehand."""
    store = ["--store", finished.store_root]
    same = counts(cli("plan", TINY, *store))
    assert all(row[1] == 0 for row in same.values())
    changed = counts(cli("plan", TINY, *store, "--mb-stitch.alpha", 3))
    differing = {name for name, row in changed.items() if row != same[name]}
    assert differing == {"MB-Stitch", "maze-showcase"}
    found, missing, decided = changed["MB-Stitch"]
    assert found == 0
    assert missing + decided == sum(same["MB-Stitch"]) == 24
    assert decided == same["MB-Stitch"][2]


# Runs


def test_run_and_run_again(cli: Cli, place: Place, expected: dict[str, bytes]) -> None:
    answer = cli("run", *options(place), "--results", place.root / "results")
    assert answer.code == 0
    assert "# A tiny table" in answer.out
    assert str(place.out / "report" / "index.html") in answer.out
    assert "evaluation: " in answer.err
    assert promised_bytes(place.out) == expected
    scores = (place.root / "results" / "table1" / "scores.csv").read_text()
    assert scores.startswith("row,method,score,variance,std,ci_low,ci_high,episodes,seeds,paper")

    before = {path: path.stat().st_mtime_ns for path in (place.out / "report").iterdir()}
    started = time.monotonic()
    with mock.patch("orchestrator.reproduction.open_executor", side_effect=AssertionError):
        again = cli("run", *options(place))
    assert time.monotonic() - started < 5
    assert again.code == 0
    assert "# A tiny table" in again.out
    assert promised_bytes(place.out) == expected
    assert {p: p.stat().st_mtime_ns for p in (place.out / "report").iterdir()} == before


def test_a_run_with_another_alpha_plays_only_mb_stitch(
    cli: Cli, done: Place, plan: Plan, counted: Counted, finished: Place
) -> None:
    out = done.root / "other"
    words = ["--out", out, "--store", done.store_root, "--mb-stitch.alpha", 3]
    answer = cli("run", TINY, *words, "--executor", "serial", "--tracking-uri", "none")
    assert answer.code == 0
    assert {kind for kind, key in done.store.artifacts() if key in counted.built} == {
        "maze-showcase"
    }
    assert counted.played
    assert not set(counted.played) & {task.key for task in plan.tasks.values()}
    report = (out / "report" / "table1.csv").read_text().splitlines()
    unchanged = (finished.out / "report" / "table1.csv").read_text().splitlines()
    for row, other in zip(report, unchanged, strict=True):
        assert row == other or "mb-stitch" in row.lower()


def test_the_scale_of_a_spec(cli: Cli, place: Place) -> None:
    answer = cli("run", *options(place), "--scale=smoke", "--methods", "no-stitch")
    assert answer.code == 0
    asked = json.loads((place.out / "spec.json").read_text())
    assert (asked["scale"], asked["seeds"], asked["episodes"]) == ("smoke", [0], 3)
    assert [method["name"] for method in asked["methods"]] == ["no-stitch"]


# How it exits


def test_a_directory_in_use_is_4(cli: Cli, done: Place) -> None:
    with done.directory.locked():
        for words in (["run", *options(done)], ["report", done.out]):
            answer = cli(*words)
            assert answer.code == 4
            assert answer.err.startswith(f"error: {done.out} is in use by process ")


def test_a_changed_spec_is_5(cli: Cli, done: Place) -> None:
    answer = cli("run", *options(done), "--episodes", 7)
    assert answer.code == 5
    assert "episodes: 6 → 7" in answer.err


def test_nondeterminism_is_6(cli: Cli, trained: Place, finished: Place, plan: Plan) -> None:
    """Another run over the same store has other bytes for the same block."""
    key = next(iter(plan.tasks.values())).key
    trained.out.mkdir()
    ledger = trained.directory.ledger()
    (theirs,) = finished.directory.ledger(read_only=True).raw([key])
    ledger.close()

    class Other(Counted):
        def next(self) -> Report:
            trained.shared().record([(key, theirs[1] + b" ")])
            return super().next()

    with mock.patch("orchestrator.reproduction.open_executor", return_value=Other()):
        answer = cli("run", *options(trained))
    assert answer.code == 6
    assert f"block {key} was played before with other bytes" in answer.err


def test_bad_data_is_7(cli: Cli, place: Place, finished: Place, plan: Plan) -> None:
    key = plan.datasets["demonstrations"]
    kind = plan.recipes[key].kind
    real = finished.store.read(kind, key)
    actions = real.arrays["actions"].copy()
    actions[5] = np.nan
    place.store.write(kind, key, Artifact(real.arrays | {"actions": actions}, real.info), {})
    answer = cli("run", *options(place))
    assert answer.code == 7
    file = place.store.path(kind, key) / "actions.npy"
    assert f"{file}: row 5 is not finite" in answer.err


def test_blocks_given_up_are_3_with_the_partial_table(
    cli: Cli, trained: Place, monkeypatch: pytest.MonkeyPatch
) -> None:
    def faulty(*arguments: Any) -> Segments:
        if any(getattr(item, "prefix", ()) == ("g0",) for item in arguments):
            raise RuntimeError("the simulator fell over")
        return play_segment(*arguments)

    monkeypatch.setattr(playing, "play_segment", faulty)
    answer = cli("run", *options(trained))
    assert answer.code == 3
    assert "# A tiny table" in answer.out
    assert "partial" in answer.out.lower()
    assert "error: 4 blocks were given up" in answer.err
    assert "the same command tries again" in answer.err

    status = cli("status", trained.out, "--store", trained.store_root)
    assert status.code == 0
    assert status.out.count("given up") == 4


def test_a_disk_that_refuses_is_3(cli: Cli, place: Place) -> None:
    place.out.write_text("in the way")
    answer = cli("run", *options(place))
    assert answer.code == 3
    assert f"error: cannot write {place.out}: " in answer.err


def test_an_interrupt_is_130(cli: Cli, trained: Place) -> None:
    with mock.patch("orchestrator.work.playing.play_segment", side_effect=KeyboardInterrupt):
        answer = cli("run", *options(trained))
    assert answer.code == 130
    assert "the same command resumes" in answer.err


# The other commands


SLOW = {"torch._C", "scipy.spatial", "ray", "pandas", "mlflow", "optuna", "robosuite", "matplotlib"}
"""Packages, or what of them is there only once they are loaded."""


def loaded(*words: object) -> set[str]:
    """Modules that a process has after a command."""
    code = f"""
import sys
from orchestrator.cli import main
try:
    main({list(map(str, words))!r})
except SystemExit:
    pass
print(*sys.modules)
"""
    asked = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert asked.returncode == 0, asked.stderr
    return set(asked.stdout.splitlines()[-1].split())


@pytest.mark.parametrize("word", ["--help", "--version", "doktor"])
def test_an_answer_that_needs_no_simulator_imports_none(word: str) -> None:
    assert not loaded(word) & (SLOW | {"torch", "mujoco", "numpy"})


def test_status_imports_nothing_that_computes(finished: Place) -> None:
    assert not loaded("status", finished.out) & (SLOW | {"torch", "mujoco"})


def test_a_plan_imports_neither_torch_nor_what_draws() -> None:
    assert not loaded("plan", "table1") & SLOW


def test_output_that_nobody_reads_is_no_error() -> None:
    command = [sys.executable, "-m", "orchestrator.cli", "run", "--help"]
    unread = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    assert unread.stdout
    assert unread.stderr
    unread.stdout.close()  # as `| head` does when it has enough
    assert unread.stderr.read() == ""
    unread.stderr.close()
    assert unread.wait() == 141


def test_status(cli: Cli, finished: Place, plan: Plan) -> None:
    answer = cli("status", finished.out, "--store", finished.store_root)
    assert answer.code == 0
    count = len(plan.recipes)
    assert f"artifacts  {count} of {count}" in answer.out
    played = len(finished.finished_blocks())
    assert f"blocks     {played} played of at most {len(plan.tasks)}" in answer.out
    assert str(finished.out / "report" / "index.html") in answer.out


def test_status_looks_into_the_store_that_the_run_was_made_over(
    cli: Cli, finished: Place, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked = cli("status", finished.out, "--store", finished.store_root)
    monkeypatch.chdir(tmp_path)
    assert cli("status", finished.out) == asked


def test_report(cli: Cli, done: Place, expected: dict[str, bytes]) -> None:
    shutil.rmtree(done.out / "report")
    answer = cli("report", done.out, "--results", done.root / "results")
    assert answer.code == 0
    assert promised_bytes(done.out) == expected
    exported = done.root / "results" / "table1"
    assert (exported / "scores.csv").read_bytes() == expected["report/table1.csv"]
    kept, shown = (exported / "table.md").read_text(), expected["report/table1.md"].decode()
    assert kept.replace("(scores.csv)", "(table1.csv)") == re.sub(r"\(table1-", "(", shown)
    assert str(exported) in answer.out


def test_the_same_results_made_again_elsewhere_change_no_exported_file(
    cli: Cli, done: Place, tmp_path: Path
) -> None:
    results, runs, exported = tmp_path / "results", ("first", "second"), []
    for name in runs:
        words = [TINY, "--out", tmp_path / name, *options(done)[3:], "--results", results]
        assert cli("run", *words).code == 0
        exported.append({file: file.read_bytes() for file in results.rglob("*") if file.is_file()})
    first, second = ((tmp_path / name / "provenance.json").read_text() for name in runs)
    assert first != second
    assert exported[0] == exported[1]


def test_results_of_a_larger_run_stay(cli: Cli, place: Place, done: Place) -> None:
    """Refused before anything runs, and where a report is exported; --force is asked for both."""
    results = place.root / "larger"
    (results / "table1").mkdir(parents=True)
    kept = results / "table1" / "provenance.json"
    kept.write_text(provenance_text({}, {"scale": "paper", "seeds": 99}))
    before = kept.read_bytes()
    for words in (["run", *options(place)], ["report", done.out]):
        refused = cli(*words, "--results", results)
        assert refused.code == 2
        assert "--force to replace it" in refused.err
        assert kept.read_bytes() == before
    assert not place.out.exists()
    assert cli("report", done.out, "--results", results, "--force").code == 0
    assert kept.read_bytes() != before


def test_report_of_a_run_that_has_not_played_yet(cli: Cli, spec: Spec, place: Place) -> None:
    claim_for_spec(place.directory, spec)
    answer = cli("report", place.out)
    assert answer.code == 2
    assert "segments.parquet" in answer.err


def test_compare(cli: Cli, finished: Place, tmp_path: Path, spec: Spec) -> None:
    other = with_sections(spec, replace(section(spec, MBStitchSettings), alpha=3.0))
    carry_out(other, serially(tmp_path / "other", finished.store_root))
    answer = cli("compare", finished.out, tmp_path / "other")
    assert answer.code == 0
    assert finished.out.name in answer.out
    assert "other" in answer.out
    assert "2 goals" in answer.out
    for method in other.methods:
        assert f"| {method} |" in answer.out


def test_gc(cli: Cli, done: Place, plan: Plan, expected: dict[str, bytes], spec: Spec) -> None:
    other = done.root / "other"
    changed = with_sections(
        replace(spec, seeds=3), replace(section(spec, MBStitchSettings), alpha=3.0)
    )
    carry_out(changed, serially(other, done.store_root))

    def everything() -> tuple[set[tuple[str, str]], set[str]]:
        shared = done.shared()
        try:
            return set(done.store.artifacts()), shared.finished()
        finally:
            shared.close()

    wanted, unwanted = (
        done.store.checkpoints(key) for key in (plan.by_seed("agent")[0], "of-no-run-that-is-kept")
    )
    for folder in (wanted, unwanted):
        folder.mkdir()

    before = everything()
    assert "would delete 0 blocks" in cli("gc", done.out, other, "--store", done.store_root).out
    answer = cli("gc", done.out, "--store", done.store_root)
    assert answer.code == 0
    assert "nothing was touched; add --delete to do it" in answer.out
    assert everything() == before

    answer = cli("gc", done.out, "--store", done.store_root, "--delete")
    assert answer.code == 0
    artifacts, blocks = everything()
    assert {key for _, key in artifacts} == set(plan.recipes)
    assert blocks == done.finished_blocks()
    assert answer.out.count("deleted ") == len(before[0]) - len(artifacts) + 2
    assert wanted.is_dir()
    assert not unwanted.exists()
    with mock.patch("orchestrator.reproduction.open_executor", side_effect=AssertionError):
        assert cli("run", *options(done)).code == 0
    assert promised_bytes(done.out) == expected
    carry_out(changed, serially(other, done.store_root))  # what was deleted is made again


def test_paths_with_characters_that_mean_something_in_a_uri(
    cli: Cli, finished: Place, tmp_path: Path
) -> None:
    place = Place(tmp_path / "seed#1 50%? done%20")
    shutil.copytree(finished.root, place.root)
    played = len(finished.finished_blocks())
    assert f"blocks     {played} played" in cli("status", place.out).out
    for words in (["plan", TINY, "--store"], ["gc", place.out, "--store"]):
        there = cli(*words, place.store_root).out
        assert there == cli(*words, finished.store_root).out.replace(
            str(finished.root), str(place.root)
        )
    assert set(tmp_path.iterdir()) == {place.root}


def test_gc_deletes_nothing_while_a_run_uses_the_store(cli: Cli, done: Place, spec: Spec) -> None:
    """Not even what no run needs: one at work has not yet said what it needs."""
    other = done.root / "other"
    changed = with_sections(spec, replace(section(spec, MBStitchSettings), alpha=4.5))
    found: list[int] = []

    def play(*_: object) -> NoReturn:
        found.append(cli("gc", done.out, "--store", done.store_root, "--delete").code)
        raise KeyboardInterrupt

    before = set(done.store.artifacts())
    with (
        mock.patch("orchestrator.work.playing.BlockPlayer.play", side_effect=play),
        pytest.raises(KeyboardInterrupt),
    ):
        carry_out(changed, serially(other, done.store_root))
    assert found == [LockedError.exit_code]
    assert set(done.store.artifacts()) == before
    assert cli("gc", done.out, "--store", done.store_root, "--delete").code == 0


def test_gc_makes_nothing_of_a_folder_that_is_no_store(cli: Cli, done: Place) -> None:
    folder = done.root / "elsewhere"
    answer = cli("gc", done.out, "--store", folder, "--delete")
    assert answer.code == 2
    assert f"{folder} is no store" in answer.err
    assert not folder.exists()


def test_gc_keeps_everything_where_a_name_is_wrong(cli: Cli, done: Place) -> None:
    before = set(done.store.artifacts())
    answer = cli("gc", done.out, done.root / "typo", "--store", done.store_root, "--delete")
    assert answer.code == 2
    assert f"{done.root / 'typo'} is no run directory" in answer.err
    assert set(done.store.artifacts()) == before


# The installed command, in a process of its own and with everything on


@pytest.mark.slow
def test_the_installed_command(place: Place, expected: dict[str, bytes]) -> None:
    skillstitch = Path(sys.executable).with_name("skillstitch")
    command: list[str | Path] = [skillstitch, "run", TINY, "--executor", "serial"]
    paths: list[str | Path] = ["--out", place.out, "--store", place.store_root]
    for _ in range(2):
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        answer = subprocess.run([*command, *paths], capture_output=True, text=True, timeout=240)
        assert answer.returncode == 0, answer.stderr
        assert "# A tiny table" in answer.stdout
        assert promised_bytes(place.out) == expected
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    spent = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    assert spent < 15  # the second time, nothing is trained, simulated or drawn
    assert list((place.out / "report" / "figures").glob("*.svg"))
    assert (place.root / "mlflow.db").is_file()

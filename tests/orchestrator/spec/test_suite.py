"""Suites: one table over several runs, on the tiny maze."""

import shutil
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any
from unittest import mock

import pandas as pd
import pytest

from orchestrator.cli import main
from orchestrator.errors import ChangedError, IncompleteError, LockedError, UsageError
from orchestrator.reproduction import reproduce
from orchestrator.spec.spec import TableSpec
from orchestrator.spec.structure import Plain, to_plain
from orchestrator.spec.suite import Suite, load_asked
from orchestrator.spec.tomls import Scale
from orchestrator.storage.merge import (
    Naming,
    describe_suite,
    diagnosis_of_part,
    merge_again,
    showcase_of_part,
    stitches_of_part,
)
from orchestrator.storage.rundir import RunDirectory
from orchestrator.suite_reproduction import reproduce_suite
from orchestrator.work import playing
from orchestrator.work.progress import Silent
from stitching.rollout import Segments, play_segment
from tests.orchestrator.tiny import TINY, promised_bytes, serially

SUITE = Path(__file__).parents[1] / "suite.toml"
OTHER_TASKS = """
name = "lists"
title = "Two lists of tasks"
methods = ["no-stitch", "mb-stitch"]
seeds = 1
[[parts]]
label = "short"
base = "BASE"
settings = { tasks = ["g0>g1"], step_limits = { 2 = 12, 3 = 30 } }
[[parts]]
label = "long"
base = "BASE"
settings = { tasks = ["g0>g3", "g0>g1>g2"] }
[[tables]]
id = "lists"
paper = ""
rows = "task"
"""


def levels() -> Suite:
    suite = load_asked(str(SUITE), "smoke")
    assert isinstance(suite, Suite)
    return suite


def lists(folder: Path) -> Suite:
    file = folder / "lists.toml"
    file.write_text(OTHER_TASKS.replace("BASE", str(TINY)))
    suite = load_asked(str(file))
    assert isinstance(suite, Suite)
    return suite


def test_a_part_may_have_settings_of_its_own_at_a_scale(tmp_path: Path) -> None:
    file = tmp_path / "scaled.toml"
    content = SUITE.read_text().replace('base = "tiny"', f'base = "{TINY}"')
    scales = "scales = { smoke = { data = { episodes = 3 } } }"
    asked = "settings = { data = { episodes = 6 } }"
    file.write_text(content.replace(asked, f"{asked}\n{scales}"))
    expected: dict[Scale, int] = {"smoke": 3, "paper": 6}
    for scale, episodes in expected.items():
        suite = load_asked(str(file), scale)
        assert isinstance(suite, Suite)
        assert to_plain(suite.parts[0].spec.data)["episodes"] == episodes
    file.write_text(content.replace(asked, scales.replace("smoke", "smok")))
    with pytest.raises(UsageError, match="no scale 'smok'"):
        load_asked(str(file))


@pytest.fixture(autouse=True)
def no_figures() -> Iterator[None]:
    with mock.patch("analysis.report.draw_figures", return_value=[]):
        yield


def carry_out(suite: Suite, root: Path) -> RunDirectory:
    return reproduce_suite(suite, serially(root / "out", root / "store"), Silent())


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("levels")
    with mock.patch("analysis.report.draw_figures", return_value=[]):
        carry_out(levels(), root)
    return root


@pytest.fixture
def done(finished: Path, tmp_path: Path) -> Path:
    shutil.copytree(finished, tmp_path / "done")
    return tmp_path / "done"


def own_scores(out: Path, label: str) -> pd.Series:
    """Mean score of each method, from a part's own episodes; every task weighs the same."""
    episodes = pd.read_parquet(out / "parts" / label / "episodes.parquet")
    return episodes.groupby(["method", "task"])["score"].mean().groupby("method").mean()


def test_a_row_is_a_part_s_own_numbers(finished: Path) -> None:
    out = finished / "out"
    table = pd.read_csv(out / "report" / "levels.csv").set_index(["row", "method"])
    assert list(dict.fromkeys(row for row, _ in table.index)) == ["level-1", "level-2"]
    for row, method in table.index:
        own = own_scores(out, row)[method]
        assert table["score"][row, method] == pytest.approx(own, abs=1e-6)
    # Table 5's rows are means over one task, and not over the maze's.
    assert len(levels().parts[0].spec.all_tasks) > 1
    assert table["paper_score"].isna().all()
    gains = pd.read_csv(out / "report" / "levels-gains.csv")
    asked = levels().parts[0].spec
    assert set(gains["pairs"]) == {len(asked.all_tasks) * asked.episodes}
    assert set(gains["method"]) == {"mb-stitch"}


def test_parts_of_other_tasks_are_cut_at_their_own_limits(tmp_path: Path) -> None:
    suite = lists(tmp_path)
    out = carry_out(suite, tmp_path).path
    table = pd.read_csv(out / "report" / "lists.csv").set_index(["row", "method"])["score"]
    rows = {"g0 → g1": "short", "g0 → g3": "long", "g0 → g1 → g2": "long"}
    assert set(table.index.get_level_values("row")) == set(rows)
    for row, method in table.index:
        episodes = pd.read_parquet(out / "parts" / rows[row] / "episodes.parquet")
        played = episodes[episodes["task"] == row.replace(" → ", ">")]
        own = played[played["method"] == method]["score"].mean()
        assert table[row, method] == pytest.approx(own, abs=1e-6)
    assert describe_suite(suite)["parts"][0]["step_limits"]["2"] == 12


def test_again_does_nothing(done: Path) -> None:
    carry_out(levels(), done)  # a copy: its store is another
    files = [file for file in (done / "out").rglob("*.*") if "ledger" not in file.name]
    before = {file: file.stat().st_mtime_ns for file in files}
    with mock.patch("orchestrator.reproduction.open_executor", side_effect=AssertionError):
        carry_out(levels(), done)
    assert {file: file.stat().st_mtime_ns for file in files} == before


def test_stopped_between_parts(finished: Path, tmp_path: Path) -> None:
    import orchestrator.suite_reproduction as carrying

    calls = []

    def dying(*arguments: Any) -> RunDirectory:
        calls.append(arguments)
        if len(calls) == 2:
            raise KeyboardInterrupt
        return reproduce(*arguments)

    with mock.patch.object(carrying, "reproduce", dying), pytest.raises(KeyboardInterrupt):
        carry_out(levels(), tmp_path)
    directory = RunDirectory(tmp_path / "out")
    assert directory.part("level-1").finished
    assert not directory.finished
    main(["report", str(tmp_path / "out")])
    assert "Partial table" in (tmp_path / "out" / "report" / "levels.md").read_text()
    assert carry_out(levels(), tmp_path).finished
    assert promised_bytes(tmp_path / "out") == promised_bytes(finished / "out")


def test_a_part_that_gives_up_blocks(
    done: Path, finished: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    shutil.rmtree(done / "out")
    (done / "store" / "blocks.sqlite").unlink()
    second = levels().parts[1].spec

    def faulty(*arguments: Any) -> Segments:
        if any(getattr(item, "prefix", ()) == ("g0",) for item in arguments):
            raise RuntimeError("the simulator fell over")
        return play_segment(*arguments)

    monkeypatch.setattr(playing, "play_segment", faulty)
    with pytest.raises(IncompleteError, match="blocks of level-1, level-2 were given up"):
        carry_out(levels(), done)
    text = (done / "out" / "report" / "levels.md").read_text()
    assert "Partial table" in text
    assert f"of {len(second.all_tasks) * second.episodes}" in text
    monkeypatch.undo()
    with mock.patch("analysis.report.draw_figures", return_value=[]):
        carry_out(levels(), done)
    assert promised_bytes(done / "out") == promised_bytes(finished / "out")


def test_stitches_taken_apart_are_kept_by_part(done: Path, tmp_path: Path) -> None:
    """Under the names that skills have where all parts meet."""
    study = {
        "pairs": [
            {"first": "", "second": "g1", "arrived": 1},  # a first skill
            {"first": "g0", "second": "g1", "arrived": 1},
        ],
        "stitches": [{"first": "g0", "second": "g1", "episode": 0}],
        "typical_distance": {"g1": 0.1},
    }
    directory = RunDirectory(done / "out")
    directory.part("level-2").write_json("stitches.json", study)
    merge_again(directory)
    assert directory.read_json("stitches.json") == {"parts": {"level-2": study}}
    suite = lists(tmp_path)
    renamed = stitches_of_part(study, Naming(suite, suite.parts[0]))
    assert renamed["pairs"] == [
        {"first": "", "second": "short:g1", "arrived": 1},
        {"first": "short:g0", "second": "short:g1", "arrived": 1},
    ]
    assert renamed["stitches"][0]["second"] == "short:g1"
    assert renamed["typical_distance"] == {"short:g1": 0.1}


def test_parts_may_differ_in_whether_first_skills_are_stitched_to(tmp_path: Path) -> None:
    suite = lists(tmp_path)
    stitched, plain = suite.parts
    rollout = replace(stitched.spec.rollout, first_stitch=True)
    stitched = replace(stitched, spec=replace(stitched.spec, rollout=rollout))
    suite = replace(suite, parts=(stitched, plain))
    own = {m["name"]: m["own_first_skill"] for m in describe_suite(suite)["methods"]}
    assert own == {"no-stitch": False, "mb-stitch": True}
    assert Naming(suite, stitched).played_by("mb-stitch") == ["mb-stitch"]
    assert Naming(suite, stitched).played_by("") == [""]
    assert Naming(suite, plain).played_by("") == ["", "mb-stitch"]


def test_what_is_known_of_models_is_kept_by_part(tmp_path: Path) -> None:
    suite = lists(tmp_path)
    study = {
        "predictions": {"1": {}},
        **{name: {"g0": 1} for name in ("values", "prices", "competence")},
        "forecast": [{"first": "g0", "second": "g1", "success": 0.5}],
    }
    renamed = diagnosis_of_part(study, Naming(suite, suite.parts[0]))
    assert renamed["predictions"] == {"1": {}}
    assert renamed["forecast"] == [{"first": "short:g0", "second": "short:g1", "success": 0.5}]
    assert all(renamed[name] == {"short:g0": 1} for name in ("values", "prices", "competence"))
    earlier = {name: found for name, found in study.items() if name != "prices"}
    del renamed["prices"]
    assert diagnosis_of_part(earlier, Naming(suite, suite.parts[0])) == renamed


def test_every_part_is_shown_under_the_names_of_the_whole(done: Path, tmp_path: Path) -> None:
    shown = RunDirectory(done / "out").read_json("showcase.json")["parts"]
    assert list(shown) == ["level-1", "level-2"]
    methods = [episode["method"] for episode in shown["level-2"]["episodes"]]
    assert methods == ["no-stitch@level-2", "mb-stitch@level-2"]
    physical: Plain = {
        "task": "g0>g1",
        "accomplished_by_all": {"mb-stitch": [2]},
        "episodes": [{"method": "mb-stitch", "skill": ["g0", "g1"]}],
    }
    suite = lists(tmp_path)
    renamed = showcase_of_part(physical, Naming(suite, suite.parts[0]))
    assert renamed["task"] == "short:g0>short:g1"
    assert renamed["episodes"][0]["skill"] == ["short:g0", "short:g1"]
    assert physical["episodes"][0]["skill"] == ["g0", "g1"], "it was changed in place"


def test_refusals(done: Path) -> None:
    suite = levels()
    changed = replace(suite.parts[1], spec=replace(suite.parts[1].spec, root_seed=1))
    with pytest.raises(ChangedError, match="part level-2, root_seed: 0 → 1"):
        carry_out(replace(suite, parts=(suite.parts[0], changed)), done)
    with RunDirectory(done / "out").locked(), pytest.raises(LockedError, match="in use by"):
        carry_out(suite, done)
    with pytest.raises(UsageError, match="set seeds in the suite's file, or give --seeds"):
        replace(
            suite, parts=(suite.parts[0], replace(changed, spec=replace(changed.spec, seeds=2)))
        )
    for rows in ("task", "length"):
        with pytest.raises(UsageError, match="would be counted as one"):
            replace(suite, tables=(replace(suite.tables[0], rows=rows),))


@pytest.mark.parametrize(
    ("label", "base", "message"),
    [
        ("low noise", 'base = "table1"', r"parts\[0\], label: 'low noise' is no name"),
        ("low", "", "part low: neither base nor benchmark; name a spec as its base"),
    ],
)
def test_a_part_that_is_not_said_well(tmp_path: Path, label: str, base: str, message: str) -> None:
    path = tmp_path / "mine.toml"
    path.write_text(
        f'name = "mine"\ntitle = "Mine"\n[[parts]]\nlabel = "{label}"\n{base}\n'
        '[[tables]]\nid = "mine"\npaper = ""\nrows = "variant"\n'
    )
    with pytest.raises(UsageError, match=message):
        load_asked(str(path), "smoke")


def test_a_run_has_no_variants() -> None:
    spec = levels().parts[0].spec
    table = TableSpec("mine", "", rows="variant")
    with pytest.raises(UsageError, match=r"rows 'variant' need \[\[parts\]\]"):
        replace(spec, tables=(table,))


def test_the_other_commands(done: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out, store = str(done / "out"), ["--store", str(done / "store")]
    main(["plan", str(SUITE), "--scale", "smoke", "--episodes", "5", *store])
    text = capsys.readouterr().out
    assert "part level-1" in text
    assert "all 2 parts: 240 episodes" in text  # 2 × 6 tasks × 4 methods × 5
    main(["status", out, *store])
    text = capsys.readouterr().out
    assert text.count("artifacts ") == 2
    main(["gc", out, *store])
    text = capsys.readouterr().out
    assert "would delete 0 blocks" in text
    assert text.count("would delete") == 1
    main(["compare", out, out])
    assert "level-2" in capsys.readouterr().out
    words = ["--executor", "serial", "--tracking-uri", "none", "--results", str(done / "results")]
    main(["run", str(SUITE), "--scale", "smoke", "--out", out, *store, *words])
    assert "# Two data sets" in capsys.readouterr().out
    assert (done / "results" / "levels" / "scores.csv").is_file()


@pytest.mark.parametrize("name", ["table3", "table5"])
def test_the_standard_scale_is_the_paper_s_seeds_and_half_its_episodes(name: str) -> None:
    suite = load_asked(name, "standard")
    assert isinstance(suite, Suite)
    assert {(part.spec.seeds, part.spec.episodes) for part in suite.parts} == {(3, 50)}

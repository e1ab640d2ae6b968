"""People's own data in plans and runs: named by content, read by the driver, checked beforehand."""

import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from orchestrator.benchmarks.registry import BENCHMARKS, ENTRIES
from orchestrator.cli import main
from orchestrator.errors import BadDataError, UsageError
from orchestrator.export import dataset_id, export_run
from orchestrator.printing import data_lines
from orchestrator.spec.spec import Spec, load_spec
from orchestrator.storage.claim import describe
from orchestrator.storage.datasets import own_data
from orchestrator.work.building import Builds
from orchestrator.work.plan import Plan, make_plan
from orchestrator.work.progress import Silent
from stitching.data.kitchen.demonstrations import KitchenDataConfig
from tests.orchestrator.benchmarks.written import idle, maze_demonstrations, write_maze
from tests.orchestrator.tiny import TINY, Counted, Place, carry_out, serially

SPECS = {
    "maze": "table1",
    "kitchen": "table2",
    "robosuite-door": "table3-door",
    "robosuite-can": "table3-can",
}


def of_file(file: object, benchmark: str = "maze") -> Spec:
    """The benchmark's packaged spec with data of one's own."""
    spec = load_spec(SPECS[benchmark], "smoke")
    return replace(spec, data=replace(spec.data, file=str(file)))


def of_people(source: object) -> Spec:
    spec = load_spec("table2", "smoke")
    return replace(spec, data=KitchenDataConfig(source="human", human=str(source)))


def recipe_params(plan: Plan) -> dict[str, Any]:
    (key,) = plan.datasets.values()
    return plan.recipes[key].params


@pytest.mark.parametrize("benchmark", SPECS)
def test_every_benchmark_takes_labelled_episodes(benchmark: str, tmp_path: Path) -> None:
    """Nothing else is learned from, and titles of tables say so."""
    file = tmp_path / "mine.npz"
    arrays = idle(BENCHMARKS[benchmark])
    if BENCHMARKS[benchmark].actions.discrete:
        arrays["actions"][:, 0] = 1
    np.savez(file, **arrays)
    spec = of_file(file, benchmark)
    plan = make_plan(spec)
    (key,) = plan.datasets.values()
    data = own_data(plan.recipes[key]).arrays
    skills = len(BENCHMARKS[benchmark].skills)
    assert data["episode_skills"].tolist() == list(range(skills))
    assert data["episode_successes"].all()
    assert all(each["title"].endswith("(data: mine.npz)") for each in describe(spec)["tables"])
    assert ENTRIES[benchmark].long_horizon(spec.data) == ""


def test_the_maze_s_own_demonstrations_written_to_a_file(tmp_path: Path) -> None:
    """Read back, they are what they were."""
    plan = make_plan(of_file(write_maze(tmp_path / "mine.npz")))
    (key,) = plan.datasets.values()
    data = own_data(plan.recipes[key]).arrays
    for name, column in maze_demonstrations().columns().items():
        np.testing.assert_array_equal(data[name], column)
        assert data[name].dtype == column.dtype


def test_an_exported_dataset_is_own_data(
    finished: Place, plan: Plan, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    list(export_run(finished.directory, tmp_path / "exported", None))
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path / "exported" / "datasets"))
    own = make_plan(of_file(dataset_id(plan, "demonstrations")))
    (key,) = own.datasets.values()
    ours, real = own_data(own.recipes[key]), plan.datasets["demonstrations"]
    for name, column in finished.store.read("maze-demonstrations", real).arrays.items():
        np.testing.assert_array_equal(ours.arrays[name], column)


def test_a_run_learns_from_them(spec: Spec, tmp_path: Path) -> None:
    """Episodes of no skill teach the dynamics; what nothing accomplishes is named in tables."""
    skills = np.repeat(["g0", "g1", "g2", ""], 10)
    file = write_maze(tmp_path / "mine.npz", skills=skills)
    own = replace(spec, seeds=1, episodes=2, data=replace(spec.data, file=str(file)))
    run = carry_out(own, serially(tmp_path / "run", tmp_path / "store"))
    (dataset,) = run.read_json("datasets.json")
    assert (dataset["episodes"], dataset["skills"]) == (40, {"g0": 10, "g1": 10, "g2": 10})
    assert "No demonstration accomplishes g3" in (run.path / "report" / "table1.md").read_text()
    shutil.move(file, tmp_path / "moved.npz")
    with pytest.raises(UsageError, match=r"data\.file: no file .*mine\.npz"):
        make_plan(own)


@pytest.mark.parametrize("asked", [of_file, of_people])
def test_they_are_named_by_their_content(asked: Any, tmp_path: Path) -> None:
    def dataset(content: int) -> str:
        file = tmp_path / "mine.npz"
        np.savez(file, observations=np.full((3, 59), content))
        return make_plan(asked(file)).datasets["demonstrations"]

    assert dataset(1) == dataset(1) != dataset(2)


def minari_folder(root: Path, name: str) -> Path:
    data = root / name / "data"
    data.mkdir(parents=True)
    (data / "metadata.json").write_text("{}")
    return data


@pytest.mark.parametrize("asked", [of_file, of_people])
def test_a_minari_dataset_is_named_by_its_content(
    asked: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path))
    folder = minari_folder(tmp_path, "kitchen/mine-v0")

    def dataset(content: str) -> str:
        (folder / "main_data.hdf5").write_text(content)
        return make_plan(asked("kitchen/mine-v0")).datasets["demonstrations"]

    assert dataset("one") == dataset("one") != dataset("other")


def test_workers_may_be_where_the_file_is_not(tmp_path: Path) -> None:
    place, executor = Place(tmp_path), Counted()
    file = write_maze(tmp_path / "mine.npz", episode_ends=np.array([4]))
    plan = make_plan(of_file(file))
    builds = Builds(plan, place.store, place.directory.ledger(), executor, Silent())
    with pytest.raises(BadDataError, match=r"mine\.npz: episode_ends, row 0: 4, with"):
        builds.run(plan.needed, set())
    assert not executor.built


@pytest.mark.parametrize("asked", [of_file, of_people])
@pytest.mark.parametrize(
    ("source", "complaint"),
    [
        ("gone.npz", "no file gone.npz"),
        ("kitchen/gone-v0", "no Minari dataset at .*minari download kitchen/gone-v0"),
    ],
)
def test_they_must_be_there(asked: Any, source: str, complaint: str) -> None:
    with pytest.raises(UsageError, match=rf"data\.(file|human): {complaint}"):
        make_plan(asked(source))


def test_people_s_recordings_must_be_named() -> None:
    with pytest.raises(UsageError, match=r"data\.human: name an \.npz file or a Minari dataset"):
        make_plan(of_people(""))
    with pytest.raises(ValueError, match="file: names the data, and so does human"):
        KitchenDataConfig(source="human", human="a.npz", file="b.npz")


@pytest.mark.parametrize("asked", [of_file, of_people])
def test_a_folder_that_is_no_dataset_is_not_read(asked: Any, tmp_path: Path) -> None:
    """It may hold anything, and much of it: a file nobody may read is not touched."""
    (tmp_path / "large").mkdir()
    (tmp_path / "large" / "unreadable").symlink_to("/proc/self/mem")
    with pytest.raises(UsageError, match=r"large is neither an \.npz file nor a Minari dataset"):
        make_plan(asked(tmp_path / "large"))


# What plans say of them


def test_a_plan_names_what_nothing_accomplishes(place: Place, tmp_path: Path) -> None:
    """Before anything is in the store."""
    plan = make_plan(of_file(write_maze(tmp_path / "mine.npz", without="g2")))
    (line,) = data_lines(plan, place.store)
    assert line.startswith("No demonstration accomplishes g2:")
    plan = make_plan(of_file(write_maze(tmp_path / "mine.npz")))
    assert not list(data_lines(plan, place.store))


def test_a_suite_s_plan_names_it_for_each_part(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = write_maze(tmp_path / "mine.npz", without="g2")
    suite = TINY.with_name("suite.toml")
    main(["plan", str(suite), "--data.file", str(file), "--store", str(tmp_path / "store")])
    assert capsys.readouterr().out.count("No demonstration accomplishes g2:") == 2


@pytest.mark.parametrize("spec_file", [TINY, TINY.with_name("suite.toml")], ids=["spec", "suite"])
@pytest.mark.parametrize("command", ["plan", "run"])
def test_data_that_cannot_be_used_are_7(
    command: str, spec_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """In one line; a run has not taken its directory yet."""
    actions = maze_demonstrations().actions.copy()
    actions[5] = np.nan
    file = write_maze(tmp_path / "mine.npz", actions=actions)
    words = [command, str(spec_file), "--data.file", str(file), "--store", str(tmp_path / "store")]
    if command == "run":
        words += ["--out", str(tmp_path / "run"), "--tracking-uri", "none"]
    with pytest.raises(SystemExit) as end:
        main(words)
    assert end.value.code == 7
    out, err = capsys.readouterr()
    (line,) = [each for each in err.splitlines() if each.startswith("error")]
    assert line.endswith(f"{file}: actions, row 5: not a finite number")
    assert out == ""
    assert not (tmp_path / "run" / "spec.json").exists()

"""Results kept with the code: none is lost to a smaller run, or to a folder that takes nothing."""

import json
from pathlib import Path
from typing import Any, get_args

import pytest

from analysis.report import export_results
from analysis.results import SCALES, check_results, scale_of
from analysis.run import RunError
from orchestrator.tomls import Scale


def test_every_scale_has_a_rank() -> None:
    assert sorted(SCALES) == sorted(get_args(Scale))


def kept(results: Path, scale: object) -> Path:
    folder = results / "table1"
    folder.mkdir(parents=True)
    (folder / "provenance.json").write_text(json.dumps({"scale": scale}))
    return folder


@pytest.mark.parametrize("scale", SCALES)
@pytest.mark.parametrize("there", SCALES)
def test_only_a_larger_scale_is_in_the_way(tmp_path: Path, there: str, scale: str) -> None:
    kept(tmp_path, there)
    check_results(tmp_path, ["table1"], scale, force=True)
    check_results(tmp_path, ["table2"], scale, force=False)
    if SCALES.index(scale) >= SCALES.index(there):
        check_results(tmp_path, ["table1"], scale, force=False)
    else:
        with pytest.raises(RunError, match=f"table1 holds results of {there} scale.*--force"):
            check_results(tmp_path, ["table2", "table1"], scale, force=False)


@pytest.mark.parametrize("text", ["{", "[]", '{"scale": "huge"}'])
def test_what_cannot_be_read_is_not_replaced(tmp_path: Path, text: str) -> None:
    (kept(tmp_path, "paper") / "provenance.json").write_text(text)
    with pytest.raises(RunError, match=r"provenance\.json: .*move it away"):
        check_results(tmp_path, ["table1"], "paper", force=False)


def test_a_file_in_the_way_is_found_before_anything_runs(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(RunError, match="no folder that can be written to"):
        check_results(tmp_path / "file" / "results", ["table1"], "paper", force=False)
    check_results(tmp_path / "not" / "yet", ["table1"], "paper", force=False)
    assert [path.name for path in tmp_path.iterdir()] == ["file"]


def test_an_export_says_its_scale_and_keeps_to_it(tmp_path: Path, write_run: Any) -> None:
    run_dir = write_run(tmp_path / "run", training=None, showcase=None)
    (folder,) = export_results(run_dir, tmp_path / "results")
    scale = json.loads((run_dir / "spec.json").read_text())["scale"]
    assert scale_of(folder) == scale
    provenance = folder / "provenance.json"
    provenance.write_text(provenance.read_text().replace(f'"{scale}"', '"paper"'))
    before = {path: path.read_bytes() for path in folder.iterdir() if path.is_file()}
    if scale != "paper":
        with pytest.raises(RunError, match="paper scale"):
            export_results(run_dir, tmp_path / "results")
        assert before == {path: path.read_bytes() for path in folder.iterdir() if path.is_file()}
    export_results(run_dir, tmp_path / "results", force=True)
    assert scale_of(folder) == scale


def test_all_that_is_committed_says_its_scale() -> None:
    folders = list((Path(__file__).parents[2] / "results").iterdir())
    assert len(folders) >= 8
    assert all(scale_of(folder) in SCALES for folder in folders)

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from analysis.run import load_run
from analysis.schema import RunError, RunSpec


def test_reads_a_whole_run_directory(tmp_path: Path, write_run: Callable[..., Path]) -> None:
    run = load_run(write_run(tmp_path / "run"))
    assert run.spec.name == "table1"
    assert run.spec.step_limits == {1: 50, 2: 50, 3: 50, 4: 50}
    assert len(run.training) == 4
    assert run.quarantine == []


def test_says_what_a_directory_lacks(tmp_path: Path) -> None:
    with pytest.raises(RunError, match=r"no spec\.json in .*finished at least one block"):
        load_run(tmp_path)


def test_says_which_file_is_damaged(tmp_path: Path, write_run: Callable[..., Path]) -> None:
    run_dir = write_run(tmp_path / "run")
    (run_dir / "provenance.json").write_text('{"versions": ')
    with pytest.raises(RunError, match=r"provenance\.json is not valid JSON"):
        load_run(run_dir)


def test_a_spec_without_tasks_is_refused(spec_dict: Callable[..., dict[str, Any]]) -> None:
    without = {name: value for name, value in spec_dict().items() if name != "tasks"}
    with pytest.raises(RunError, match="'tasks'"):
        RunSpec.from_dict(without)


def test_labels(spec_dict: Callable[..., dict[str, Any]]) -> None:
    spec = RunSpec.from_dict({**spec_dict(), "skill_labels": {"lig": "light switch"}})
    assert spec.task_label("bottom-burner>lig") == "bottom burner → light switch"

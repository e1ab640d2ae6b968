"""What is said of skills that no data show."""

from collections.abc import Callable
from pathlib import Path

from analysis.report import build_report
from analysis.run import load_run
from analysis.studies.data import undemonstrated, undemonstrated_note
from tests.analysis.kitchen_run import write_kitchen

WriteRun = Callable[..., Path]


def test_skills_that_tasks_ask_for_and_no_data_accomplish(
    tmp_path: Path, write_run: WriteRun
) -> None:
    datasets = [
        {"name": "a", "skills": {"microwave": 3}},
        {"name": "b", "skills": {"microwave": 1, "light switch": 2}},
    ]
    run_dir = write_kitchen(write_run, tmp_path / "run", datasets=datasets)
    run = load_run(run_dir)
    asked = {skill for task in run.spec.tasks for skill in task.split(">")}
    left_out = undemonstrated(run)
    assert set(left_out) == asked - {"microwave", "light switch"} != set()
    note = undemonstrated_note(left_out)
    assert ", ".join(left_out) in note
    build_report(run_dir)
    assert note in (run_dir / "report" / "table2.md").read_text()
    assert "Skills without data" in (run_dir / "report" / "index.html").read_text()


def test_nothing_is_said_where_all_are_shown_or_nothing_is_known(
    tmp_path: Path, write_run: WriteRun
) -> None:
    run = load_run(write_kitchen(write_run, tmp_path / "unknown"))
    assert undemonstrated(run) == []
    assert undemonstrated_note([]) == ""
    every = [{"name": "a", "skills": dict.fromkeys(run.spec.skills, 1)}]
    told = load_run(write_kitchen(write_run, tmp_path / "told", datasets=every))
    assert undemonstrated(told) == []

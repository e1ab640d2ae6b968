from collections.abc import Callable
from pathlib import Path
from typing import Any

import pandas as pd
import pytest

from analysis.report import build_report
from analysis.run import load_run
from analysis.studies.rates import HEADER, rate_lines, rate_table
from tests.analysis.kitchen_run import METHODS, kitchen_files, kitchen_segments, write_kitchen

LEVELS = {"level-1": ["microwave>kettle"], "level-2": ["kettle>light switch"]}
"""Two parts, each with a task of its own; the segments of the other's do not count."""


def merged_files() -> dict[str, Any]:
    """Kitchen's run as a suite of two levels, each of whose methods are methods of their own."""
    files = kitchen_files()
    named = {
        label: [{"name": f"{name}@{label}", "label": shown} for name, shown in METHODS.items()]
        for label in LEVELS
    }
    files["spec"] |= {
        "methods": [method for methods in named.values() for method in methods],
        "tasks": [task for tasks in LEVELS.values() for task in tasks],
        "tables": [{"id": "levels", "paper": "", "rows": "variant", "title": "Levels"}],
        "parts": [
            {
                "label": label,
                "methods": [method["name"] for method in named[label]],
                "tasks": tasks,
                "step_limits": {"2": 250},
                "block_episodes": 1,
            }
            for label, tasks in LEVELS.items()
        ],
    }
    for name in ("stitches", "diagnosis"):
        files[name] = {"parts": dict.fromkeys(LEVELS, files[name])}
    return files


def merged_run(write_run: Callable[..., Path], folder: Path) -> Path:
    plain = kitchen_segments()
    segments = plain[plain["method"] != ""]
    copies = [segments.assign(method=segments["method"] + f"@{label}") for label in LEVELS]
    return Path(write_run(folder, pd.concat(copies, ignore_index=True), **merged_files()))


def test_rates_of_every_skill_of_a_run(tmp_path: Path, write_run: Callable[..., Path]) -> None:
    rates = rate_table(load_run(write_kitchen(write_run, tmp_path / "run"))).set_index("skill")
    kettle = rates.to_dict("index")["kettle"]
    assert (kettle["own_successes"], kettle["own_trials"]) == (97, 100)
    plain = kitchen_segments().query("method == 'no-stitch' and prefix.str.endswith('>kettle')")
    assert kettle["after_successes"] == plain["success"].sum()
    assert kettle["after_trials"] == len(plain)
    assert kettle["after_low"] < kettle["after_rate"] < kettle["after_high"]
    assert kettle["beta"] == 5.0
    assert kettle["beta_scaled"] == pytest.approx(5.0 * 0.04 / 0.08)


def test_a_level_has_its_own_rates_and_no_stitched_ones(
    tmp_path: Path, write_run: Callable[..., Path]
) -> None:
    rates = rate_table(load_run(merged_run(write_run, tmp_path / "run")))
    rates = rates.set_index(["part", "skill"])
    trials = rates["after_trials"]
    assert trials[trials > 0].to_dict() == {
        ("level-1", "kettle"): 8,
        ("level-2", "light switch"): 8,
    }
    assert rates.loc[("level-1", "kettle"), "after_successes"] == 4
    lines = rate_lines(rates.reset_index())
    assert all(len(line) == len(HEADER) for line in lines)
    assert lines[0][3] == "–", "nothing comes before the microwave"


def test_they_stand_beside_the_table(tmp_path: Path, write_run: Callable[..., Path]) -> None:
    run = merged_run(write_run, tmp_path / "run")
    build_report(run)
    report = run / "report"
    assert (report / "rates.csv").is_file()
    assert "| level-1 | kettle | 0.97 (97 of 100)" in (report / "levels.md").read_text()
    assert "What there is to stitch" in (report / "index.html").read_text()

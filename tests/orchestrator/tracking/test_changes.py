"""Names tell in what runs of one spec differ."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

from orchestrator.spec.spec import Spec, load_spec
from orchestrator.storage.claim import describe
from orchestrator.tracking.changes import short_changes
from orchestrator.tracking.views import read_views
from tests.orchestrator.tiny import tiny_spec
from tests.orchestrator.tracking.fake_run import start_run


def name_of(spec: Spec, run_dir: Path) -> str:
    """Of a run that was asked for this."""
    start_run(run_dir)
    (run_dir / "spec.json").write_text(json.dumps(describe(spec)), encoding="utf-8")
    return read_views(run_dir, "RUNNING", [])[0].name


def test_what_is_as_packaged_has_no_changes(tmp_path: Path) -> None:
    for name in ("table1", "table2", "table3-can"):
        told = name_of(load_spec(name, "quick"), tmp_path / name)
        assert told == f"{name} · quick · abc1"


def test_a_changed_field_is_told_in_short(tmp_path: Path) -> None:
    spec: Any = load_spec("table1", "quick")
    table = replace(spec.tables[0], title="Another title")
    stronger = replace(spec, mb_stitch=replace(spec.mb_stitch, alpha=5.0), tables=(table,))
    assert name_of(stronger, tmp_path / "run") == "table1 · quick · α 5 · abc1"


def test_many_changes_are_counted() -> None:
    changed = [
        ("title", "Mine", "Table 1"),
        ("mb_stitch.beta", 0.5, 1.0),
        ("methods", ["no-stitch", "mb-stitch"], ["no-stitch"]),
        ("data.source", "x" * 99, "own"),
        ("seeds", 2, 5),
        ("episodes", 3, 100),
    ]
    told = short_changes(changed)
    assert told.startswith("β 0.5, methods no-stitch+mb-stitch, data.source xxx")
    assert told.endswith("x, 2 more")
    assert len(told) < 120


def test_a_spec_of_one_s_own_has_nothing_to_differ_from(tmp_path: Path) -> None:
    spec = tiny_spec()
    assert name_of(spec, tmp_path / "run") == f"{spec.name} · {spec.scale} · abc1"

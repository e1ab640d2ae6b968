"""What the sweeps' tests share: a tiny search, and what must not depend on how it was done."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any
from unittest import mock

from orchestrator.reproduction import Settings
from orchestrator.storage.rundir import RunDirectory
from orchestrator.work.progress import Silent
from sweeps.spec import SweepSpec, load_sweep
from sweeps.study import SweepStudy
from sweeps.sweep import carry_out

TINY_SWEEP = Path(__file__).with_name("tiny-sweep.toml")
STUDY_PARTS = ("number", "state", "values", "params", "user_attrs", "intermediate_values")


def tiny_sweep(**changes: Any) -> SweepSpec:
    return replace(load_sweep(str(TINY_SWEEP)), **changes)


def settings(root: Path, **changes: Any) -> Settings:
    plain = {"executor": "serial", "tracking_uri": "none"} | changes
    return Settings(root / "sweep", root / "store", **plain)


def sweep_in(
    root: Path, sweep: SweepSpec, progress: Silent | None = None, **changes: Any
) -> RunDirectory:
    """A whole sweep without figures, which would be most of its time."""
    with mock.patch("sweeps.results.report.draw_figures", return_value=[]):
        return carry_out(sweep, settings(root, **changes), progress or Silent(), root / "results")


def promised(root: Path, sweep: SweepSpec) -> dict[str, Any]:
    """The study and all that is told of it, without times and without how often it was begun."""
    study = SweepStudy(sweep, root / "sweep")
    trials = [{part: getattr(trial, part) for part in STUDY_PARTS} for trial in study.trials]
    names = ("trials.json", "confirm.json", "winner.json")
    files = {name: json.loads((root / "sweep" / name).read_text()) for name in names}
    return {"study": trials, **files}

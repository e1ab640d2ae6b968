"""What commands print: plans, progress of a run, summaries."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

from orchestrator.costs import Estimate
from orchestrator.methods import method_label
from orchestrator.plan import make_plan
from orchestrator.rundir import RunDirectory
from orchestrator.spec import Spec
from orchestrator.store import Store


def plan_lines(spec: Spec, costs: Estimate, workers: int | None) -> Iterator[str]:
    """The plan of a spec and its cost, for a person to read before anything runs."""
    tasks = len(spec.all_tasks)
    yield f"{spec.name} at {spec.scale} scale: {spec.title}"
    yield (
        f"  {tasks} tasks × {len(spec.methods)} methods × {spec.seeds} seeds × "
        f"{spec.episodes} episodes = {costs.episodes:,} episodes"
    )
    yield "artifacts              found  missing"
    for kind, (found, missing) in costs.artifacts.items():
        yield f"  {kind:<20} {found:>5}  {missing:>7}"
    yield "blocks                 found  missing  decided without playing"
    for method in ("", *spec.methods):
        label = method_label(method) if method else "first skills (all)"
        counts = costs.blocks.get(method, {})
        found, missing, decided = (counts.get(s, 0) for s in ("found", "missing", "decided"))
        yield f"  {label:<20} {found:>5}  {missing:>7}  {decided:>7}"
    yield (
        f"segments: {costs.segments_in_tree:,} in the tree, {costs.segments_naive:,} without it "
        f"({costs.segments_naive / costs.segments_in_tree:.1f} × fewer), at most"
    )
    yield (
        f"environment steps: {costs.steps_in_tree:,} in the tree, {costs.steps_naive:,} without, "
        "at most"
    )
    workers = workers or os.cpu_count() or 1
    source = "measured in this store" if costs.from_history else "from a reference machine"
    total = (costs.seconds_training + costs.seconds_evaluation) / workers
    yield f"to be played: about {costs.segments_missing:,} segments"
    yield (
        f"time: {_duration(costs.seconds_training)} training and "
        f"{_duration(costs.seconds_evaluation)} evaluation on one core, together about "
        f"{_duration(total)} on {workers} ({source})"
    )
    yield f"disk: about {max(1, costs.disk_bytes // 10**6)} MB more"


def status_lines(directory: RunDirectory, store_root: Path) -> Iterator[str]:
    """How far a run is: artifacts, blocks by method, what was given up."""
    spec = directory.spec()
    plan = make_plan(spec)
    store = Store(store_root)
    built = sum((recipe.kind, key) in store for key, recipe in plan.recipes.items())
    ledger = directory.ledger(read_only=True)
    finished, failures = ledger.finished(), ledger.failures()
    ledger.close()
    yield f"{directory.path}: {spec.name} at {spec.scale} scale"
    yield f"  artifacts  {built} of {len(plan.recipes)}"
    yield f"  blocks     {len(finished)} played of at most {len(plan.tasks)}"
    if failures:
        yield f"  failures   {len(failures)} blocks failed at least once"
    for entry in directory.read_json("quarantine.json") or []:
        yield f"  given up   seed {entry['seed']}, {entry['method']}, {entry['prefix']}"
    report = directory.path / "report" / "index.html"
    yield f"  report     {report if report.is_file() else 'not written yet'}"


def summary_lines(directory: RunDirectory) -> Iterator[str]:
    """A finished run: its tables, where its time went, where to look."""
    spec = directory.spec()
    for table in spec.tables:
        yield (directory.path / "report" / f"{table.id}.md").read_text().strip()
        yield ""
    seconds = directory.read_json("seconds.json") or {}
    phases = sorted(seconds.items(), key=lambda phase: -phase[1])
    spent = ", ".join(f"{name} {duration:.0f} s" for name, duration in phases)
    yield f"time: {sum(seconds.values()):.0f} s, of which {spent}"
    yield f"report: {directory.path / 'report' / 'index.html'}"


def _duration(seconds: float) -> str:
    if seconds < 90:
        return f"{seconds:.0f} s"
    if seconds < 5400:
        return f"{seconds / 60:.0f} min"
    return f"{seconds / 3600:.1f} h"

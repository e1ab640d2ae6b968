"""What commands print: plans, progress of a run, summaries."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from analysis.studies.data import undemonstrated_note
from orchestrator.cores import usable_cores
from orchestrator.costs.estimate import CostEstimate, estimate
from orchestrator.spec.methods import method_label
from orchestrator.spec.spec import Spec
from orchestrator.spec.suite import Suite
from orchestrator.storage.datasets import undemonstrated_skills
from orchestrator.storage.ledger import Ledger
from orchestrator.storage.rundir import RunDirectory
from orchestrator.storage.store import CorruptArtifactError, Store
from orchestrator.work.plan import Plan, make_plan


def plan_lines(spec: Spec, costs: CostEstimate, workers: int | None) -> Iterator[str]:
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
        if not method and method not in costs.blocks:
            continue  # every method stitches to first skills, and has its own
        label = method_label(method) if method else "first skills, shared"
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
    yield f"to be played: about {costs.segments_missing:,} segments"
    yield _time_line([costs], workers)
    yield _disk_line([costs])


def forecast_lines(plan: Plan, store: Store) -> Iterator[str]:
    """The forecast of pairs in the store's diagnosis; nothing where there is none."""
    key = plan.illustrations.get("diagnosis")
    if key is None or (plan.recipes[key].kind, key) not in store:
        return
    try:
        pairs = store.read(plan.recipes[key].kind, key).info.get("forecast", [])
    except CorruptArtifactError as error:
        yield f"forecast: {error}"
        return
    forecast = {(pair["first"], pair["second"]): pair["success"] for pair in pairs}
    if not forecast:
        return
    skills = list(dict.fromkeys(skill for pair in forecast for skill in pair))
    width = max(map(len, skills))
    yield "forecast: how often each second skill works after each first, without a stitch"
    yield f"  {'':<{width}}  " + "  ".join(f"{skill:>{width}}" for skill in skills)
    for first in skills:
        rates = [forecast.get((first, second)) for second in skills]
        cells = [f"{'' if rate is None else f'{rate:.2f}':>{width}}" for rate in rates]
        yield f"  {first:<{width}}  " + "  ".join(cells)


def data_lines(plan: Plan, store: Store) -> Iterator[str]:
    """What the datasets leave out, where the store has them all or people's own are read.

    Raises BadDataError where these cannot be used.
    """
    if note := undemonstrated_note(undemonstrated_skills(plan, store)):
        yield note


def _time_line(costs: list[CostEstimate], workers: int | None) -> str:
    workers = workers or usable_cores()
    training = sum(each.seconds_training for each in costs)
    evaluation = sum(each.seconds_evaluation for each in costs)
    measured = sum(each.seconds_measured for each in costs)
    return (
        f"time: {_duration(training)} training and {_duration(evaluation)} evaluation on one core, "
        f"together about {_duration((training + evaluation) / workers)} on {workers} "
        f"({_source(measured, training + evaluation)})"
    )


def _source(measured: float, seconds: float) -> str:
    """Where a time comes from."""
    share = round(100 * measured / seconds) if seconds else 100
    if not share:
        return "counted from the settings"
    rest = ", the rest counted from the settings" if share < 100 else ""
    return f"{f'{share} % of it ' if rest else ''}measured in this store{rest}"


def _disk_line(costs: list[CostEstimate]) -> str:
    return f"disk: about {max(1, sum(each.disk_bytes for each in costs) // 10**6)} MB more"


def suite_plan_lines(suite: Suite, store_root: Path, workers: int | None) -> Iterator[str]:
    """Each part's plan and cost, then those of all; what parts share counts once.

    Raises BadDataError before the first line where people's own data cannot be used.
    """
    store, shared = Store(store_root), Ledger.look(store_root / "blocks.sqlite")
    plans = [make_plan(part.spec) for part in suite.parts]
    left_out = [list(data_lines(plan, store)) for plan in plans]
    counted: set[str] = set()
    costs = []
    yield f"{suite.name} at {suite.scale} scale: {suite.title}"
    for part, plan, notes in zip(suite.parts, plans, left_out, strict=True):
        again = len(counted & set(plan.recipes))
        costs.append(estimate(plan, store, shared, counted))
        counted |= set(plan.recipes)
        yield ""
        yield f"part {part.label}" + (f", with {again} artifacts of parts above" if again else "")
        yield from plan_lines(part.spec, costs[-1], workers)
        yield from notes
    yield ""
    yield (
        f"all {len(costs)} parts: {sum(each.episodes for each in costs):,} episodes, "
        f"{sum(each.steps_in_tree for each in costs):,} environment steps at most"
    )
    yield f"to be played: about {sum(each.segments_missing for each in costs):,} segments"
    yield _time_line(costs, workers)
    yield _disk_line(costs)


def summary_lines(directory: RunDirectory) -> Iterator[str]:
    """A finished run: its tables, where its time went, where to look."""
    from analysis.page.sources import HEADING

    for table in directory.asked()["tables"]:
        file = directory.path / "report" / f"{table['id']}.md"
        yield file.read_text(encoding="utf-8").partition(HEADING)[0].strip()
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
    if seconds < 72 * 3600:
        return f"{seconds / 3600:.1f} h"
    return f"{seconds / 86400:,.0f} days"

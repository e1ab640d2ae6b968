"""What a sweep will take: what there is already, and what a trial adds to it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path

from orchestrator.costs.estimate import CostEstimate, estimate
from orchestrator.spec.spec import Spec
from orchestrator.storage.ledger import Ledger
from orchestrator.storage.store import Store
from orchestrator.work.plan import make_plan
from sweeps.search import search_spec
from sweeps.spec import SweepSpec


def plan_lines(sweep: SweepSpec, store: Path) -> Iterator[str]:
    """For a person to read before anything runs; a trial is taken to cost what the base's does."""
    spec, question = search_spec(sweep), sweep.question
    shared = _estimate(spec, store, question.shared) if question.shared else None
    one = _estimate(spec, store, question.own)
    yield (
        f"{sweep.name} at {sweep.scale} scale: {sweep.budget} trials × {len(spec.tasks)} tasks × "
        f"{spec.seeds} seed{'s' * (spec.seeds > 1)} × {spec.episodes} episodes, "
        f"{sweep.batch} trials at once"
    )
    artifacts = f"{_artifacts(spec, one)} artifacts"
    own = set(one.blocks)
    if shared is not None:
        own -= set(shared.blocks)
        firsts = "first skills" if "" in one.blocks else "No-Stitch's first skills"
        yield (
            f"  shared by all trials: {artifacts}, {_blocks(shared, [''])} of {firsts}, "
            f"{_blocks(shared, question.shared)} of No-Stitch"
        )
    there = _blocks(one, own) if shared else f"{artifacts} and {_blocks(one, own)}"
    most = sum(sum(one.blocks[method].values()) for method in own)
    yield f"  a trial: at most {most} blocks; the base's own setting has {there}"


def _estimate(spec: Spec, store: Path, methods: tuple[str, ...]) -> CostEstimate:
    ledger = Ledger.look(store / "blocks.sqlite")
    try:
        return estimate(make_plan(replace(spec, methods=methods)), Store(store), ledger)
    finally:
        ledger.close()


def _artifacts(spec: Spec, costs: CostEstimate) -> str:
    """Those that scores depend on."""
    plan = make_plan(spec)
    kinds = {recipe.kind for key, recipe in plan.recipes.items() if key in plan.needed}
    counts = [count for kind, count in costs.artifacts.items() if kind in kinds]
    return _found(*map(sum, zip(*counts, strict=True)))


def _blocks(costs: CostEstimate, methods: Iterable[str]) -> str:
    counts = [costs.blocks.get(method, {}) for method in methods]
    there = sum(count.get("found", 0) + count.get("decided", 0) for count in counts)
    return f"{_found(there, sum(count.get('missing', 0) for count in counts))} blocks"


def _found(found: int, missing: int) -> str:
    return f"{found} of {found + missing}"

"""What a sweep will take: what there is already, and what a trial adds to it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from orchestrator.costs import Estimate, estimate
from orchestrator.ledger import Ledger
from orchestrator.methods import first_method
from orchestrator.plan import make_plan
from orchestrator.spec import Spec
from orchestrator.store import Store
from sweeps.candidates import NO_STITCH
from sweeps.search import search_spec
from sweeps.spec import SweepSpec


def plan_lines(sweep: SweepSpec, store: Path) -> Iterator[str]:
    """For a person to read before anything runs; a trial is taken to cost what the base's does."""
    spec = search_spec(sweep)
    shared, one = _estimate(spec, store, NO_STITCH), _estimate(spec, store, "mb-stitch")
    yield (
        f"{sweep.name} at {sweep.scale} scale: {sweep.budget} trials × {len(spec.tasks)} tasks × "
        f"{spec.seeds} seed{'s' * (spec.seeds > 1)} × {spec.episodes} episodes, "
        f"{sweep.batch} trials at once"
    )
    needed = make_plan(replace(spec, methods=(NO_STITCH, "mb-stitch"))).needed
    kinds = {r.kind for k, r in make_plan(spec).recipes.items() if k in needed}
    own = first_method("mb-stitch", spec.rollout)
    firsts = "No-Stitch's first skills" if own else "first skills"
    artifacts = [count for kind, count in one.artifacts.items() if kind in kinds]
    yield (
        f"  shared by all trials: {_found(*map(sum, zip(*artifacts, strict=True)))} artifacts, "
        f"{_blocks(shared, '')} of {firsts}, {_blocks(shared, NO_STITCH)} of No-Stitch"
    )
    yield (
        f"  a trial: at most {sum(one.blocks.get('mb-stitch', {}).values())} blocks; the base's "
        f"own setting has {_blocks(one, 'mb-stitch')}"
    )


def _estimate(spec: Spec, store: Path, method: str) -> Estimate:
    ledger = Ledger.look(store / "blocks.sqlite")
    try:
        return estimate(make_plan(replace(spec, methods=(method,))), Store(store), ledger)
    finally:
        ledger.close()


def _blocks(costs: Estimate, method: str) -> str:
    counts = costs.blocks.get(method, {})
    there = counts.get("found", 0) + counts.get("decided", 0)
    return f"{_found(there, counts.get('missing', 0))} blocks"


def _found(found: int, missing: int) -> str:
    return f"{found} of {found + missing}"

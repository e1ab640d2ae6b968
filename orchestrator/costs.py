"""What a plan will cost before anything runs: found or missing, episodes, steps, time, disk."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

from orchestrator.ledger import Ledger
from orchestrator.plan import Plan
from orchestrator.recipes import Recipe
from orchestrator.store import CorruptArtifactError, Store

# Where this store has no history yet: measured on one core of a 2-core cloud machine.
REFERENCE_SECONDS = {
    "demonstrations": 1.0,
    "exploration": 1.0,
    "agent": 20.0,
    "mf-policy": 10.0,
    "dynamics": 15.0,
    "showcase": 1.0,
}
REFERENCE_SECONDS_PER_SEGMENT = 0.005
BYTES_PER_SEGMENT = 120


@dataclass(frozen=True)
class Estimate:
    """What is there, what is missing, and what the missing will take at most."""

    artifacts: dict[str, tuple[int, int]]  # kind → found, missing
    blocks: dict[str, tuple[int, int]]  # method ("" for first skills) → found, missing
    episodes: int  # of the finished tables: tasks × methods × seeds × episodes
    segments_in_tree: int
    segments_naive: int
    steps_in_tree: int  # environment steps if no episode ended early
    steps_naive: int
    seconds_training: float  # of one core
    seconds_evaluation: float
    disk_bytes: int
    from_history: bool  # times measured on this store, not the reference


def estimate(plan: Plan, store: Store, shared: Ledger) -> Estimate:
    """Look at store and ledger; runs nothing. Evaluation is costed as if every skill succeeded."""
    spec = plan.spec
    artifacts: dict[str, Counter[bool]] = {}
    training = 0.0
    history = _training_history(store)
    for key, recipe in plan.recipes.items():
        found = (recipe.kind, key) in store
        artifacts.setdefault(recipe.kind, Counter())[found] += 1
        if not found:
            training += history.get(_size_class(recipe), REFERENCE_SECONDS[recipe.kind])

    finished = shared.finished()
    rates = shared.seconds_per_segment()
    blocks: dict[str, Counter[bool]] = {}
    evaluation = 0.0
    missing_segments = 0
    for (node, _), task in plan.tasks.items():
        found = task.key in finished
        blocks.setdefault(node.method, Counter())[found] += 1
        if not found:
            segments = task.episodes[1] - task.episodes[0]
            missing_segments += segments
            evaluation += segments * rates.get(task.cost_name, REFERENCE_SECONDS_PER_SEGMENT)

    runs = len(spec.methods) * spec.seeds * spec.episodes
    naive_segments = sum(len(task) for task in spec.all_tasks) * runs
    naive_steps = sum(spec.step_limits[len(task)] for task in spec.all_tasks) * runs
    return Estimate(
        artifacts={kind: (c[True], c[False]) for kind, c in artifacts.items()},
        blocks={method: (c[True], c[False]) for method, c in blocks.items()},
        episodes=len(spec.all_tasks) * runs,
        segments_in_tree=len(plan.nodes) * spec.episodes,
        segments_naive=naive_segments,
        steps_in_tree=_steps_in_tree(plan),
        steps_naive=naive_steps,
        seconds_training=training,
        seconds_evaluation=evaluation,
        disk_bytes=2 * BYTES_PER_SEGMENT * missing_segments,
        from_history=bool(rates),
    )


def _steps_in_tree(plan: Plan) -> int:
    """Most steps the tree can take: along each path from the root at most one step limit.

    A leaf's path shares its steps with its siblings'; counting a whole limit at every leaf, and
    nothing above it, bounds the sum.
    """
    leaves = sum(1 for node in plan.nodes if node not in plan.children)
    return leaves * plan.spec.episodes * plan.spec.step_limit


def _training_history(store: Store) -> dict[tuple[str, str], float]:
    """Seconds that artifacts of a kind and size took before on this machine's store."""
    seconds: dict[tuple[str, str], float] = {}
    for kind, key in store.artifacts():
        try:
            made = store.manifest(kind, key)["made"]
        except CorruptArtifactError:
            continue
        recipe = Recipe(made["kind"], made["params"], made["inputs"])
        seconds[_size_class(recipe)] = made["seconds"]
    return seconds


def _size_class(recipe: Recipe) -> tuple[str, str]:
    config = recipe.params.get("config", {})
    size = [config.get(name) for name in ("updates", "width", "members", "episodes")]
    return recipe.kind, str(size)

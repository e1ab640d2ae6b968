"""What a plan will cost before anything runs: found or missing, episodes, steps, time, disk."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from typing import Literal

from orchestrator.benchmarks.registry import ENTRIES
from orchestrator.costs.effort import Training, training_of
from orchestrator.costs.expectations import Expectations
from orchestrator.costs.likeness import Likeness
from orchestrator.spec.methods import method_rollout
from orchestrator.spec.spec import Spec
from orchestrator.storage.ledger import Ledger
from orchestrator.storage.store import CorruptArtifactError, Store
from orchestrator.work.jobs import BlockTask
from orchestrator.work.plan import Node, Plan
from orchestrator.work.recipes import Recipe

OTHER_SECONDS = 1.0  # of what nobody measured, such as data of the maze

Standing = Literal["found", "decided", "missing"]


@dataclass(frozen=True)
class CostEstimate:
    """What is there, what is missing, and what the missing will take at most."""

    artifacts: dict[str, tuple[int, int]]  # kind → found, missing
    blocks: dict[str, dict[Standing, int]]  # method ("": first skills that are shared) → counts
    episodes: int  # of the finished tables: tasks × methods × seeds × episodes
    segments_missing: int  # expected
    segments_in_tree: int
    segments_naive: int
    steps_in_tree: int  # environment steps if no episode ended early
    steps_naive: int
    seconds_training: float  # of one core
    seconds_evaluation: float
    disk_bytes: int
    seconds_measured: float  # of both together, what rests on measurements in this store


def estimate(
    plan: Plan, store: Store, shared: Ledger, counted: Collection[str] = frozenset()
) -> CostEstimate:
    """Look at store and ledger; runs nothing.

    What work like it has taken in this store, and how many episodes survived it, is expected again;
    where there was none, what is counted from the settings, and as many survivors as usual in that
    benchmark.

    counted: keys of artifacts that are somebody else's to make, and cost nothing here.
    """
    spec = plan.spec
    artifacts: dict[str, Counter[bool]] = {}
    training = measured = model_bytes = 0.0
    taken = _training_seconds(plan.recipes, store)
    for key, recipe in plan.recipes.items():
        if key in counted:
            continue
        found = (recipe.kind, key) in store
        artifacts.setdefault(recipe.kind, Counter())[found] += 1
        if not found:
            training += taken[key].seconds
            measured += taken[key].seconds if taken[key].measured else 0.0
            trained = training_of(recipe)
            model_bytes += trained.bytes if trained else 0

    expected = Expectations(plan, shared.history())
    blocks: dict[str, Counter[Standing]] = {}
    evaluation = missing_segments = 0.0
    for place in standings(plan, shared, expected):
        blocks.setdefault(place.node.method, Counter())[place.standing] += 1
        if place.standing == "missing":
            missing_segments += place.arriving
            seconds = place.arriving * expected.seconds_each(place.node, place.chunk)
            evaluation += seconds
            measured += seconds if expected.measured(place.node, place.chunk) else 0.0

    runs = len(spec.methods) * spec.seeds * spec.episodes
    naive_segments = sum(len(task) for task in spec.all_tasks) * runs
    naive_steps = sum(
        min(spec.step_limits[len(task)], len(task) * _skill_limit(spec, method))
        for method in spec.methods
        for task in spec.all_tasks
    )
    return CostEstimate(
        artifacts={kind: (c[True], c[False]) for kind, c in artifacts.items()},
        blocks={method: dict(counts) for method, counts in blocks.items()},
        episodes=len(spec.all_tasks) * runs,
        segments_in_tree=len(plan.nodes) * spec.episodes,
        segments_naive=naive_segments,
        steps_in_tree=_steps_in_tree(plan),
        steps_naive=naive_steps * spec.seeds * spec.episodes,
        seconds_training=training,
        seconds_evaluation=evaluation,
        segments_missing=round(missing_segments),
        disk_bytes=round(
            2 * ENTRIES[spec.benchmark].costs.segment_bytes * missing_segments + model_bytes
        ),
        seconds_measured=measured,
    )


@dataclass(frozen=True)
class _Expected:
    seconds: float  # of one core
    measured: bool  # in this store, by work like it; else counted from the settings


def _training_seconds(recipes: Mapping[str, Recipe], store: Store) -> dict[str, _Expected]:
    """What each artifact is expected to take, by key."""
    taken, likeness = _training_history(store), Likeness(recipes)
    expected = {}
    for key, recipe in recipes.items():
        known = taken.get(likeness.of(key))
        counted = _counted_seconds(recipe, training_of(recipe)) if known is None else known
        expected[key] = _Expected(counted, known is not None)
    return expected


def training_seconds(recipes: Mapping[str, Recipe], store: Store) -> dict[str, float]:
    """Seconds of one core that each artifact is expected to take, by key."""
    return {key: one.seconds for key, one in _training_seconds(recipes, store).items()}


@dataclass(frozen=True)
class PlannedBlock:
    """A block of the tree, and what is known of it."""

    node: Node
    chunk: int
    task: BlockTask
    standing: Standing
    arriving: float  # episodes expected to play it


def standings(plan: Plan, shared: Ledger, expected: Expectations) -> Iterator[PlannedBlock]:
    """Every block of a plan, and whether it is there, not needed, or to be played.

    A block is decided without being played where no episode survived a block above it. What lies
    below a missing block counts as missing: it is, at most.
    """
    for chunk, (first, end) in enumerate(plan.chunks):
        waiting: list[tuple[Node, Standing | None, float]]
        waiting = [(root, None, end - first) for root in plan.roots()]
        while waiting:
            node, standing, arriving = waiting.pop()
            task = plan.tasks[node, chunk]
            below = standing
            if standing is None:
                outcome = next((outcome for _, outcome in shared.outcomes([task.key])), None)
                standing = "missing" if outcome is None else "found"
                below = "missing" if outcome is None else None if outcome.survivors else "decided"
            yield PlannedBlock(node, chunk, task, standing, arriving)
            surviving = arriving * expected.success_rate(node, chunk)
            if standing == "found" and outcome is not None:
                surviving = outcome.survivors
            waiting.extend((child, below, surviving) for child in plan.children.get(node, []))


def _counted_seconds(recipe: Recipe, trained: Training | None) -> float:
    if trained is not None:
        return trained.seconds
    costs = ENTRIES[recipe.params["benchmark"]].costs
    if recipe.kind in costs.demonstration:
        return costs.demonstration[recipe.kind] * _demonstrations(recipe)
    return costs.whole.get(recipe.kind, OTHER_SECONDS)


def _demonstrations(recipe: Recipe) -> float:
    """How many a dataset asks for; orders may have more or fewer by their first skill."""
    config = recipe.params["config"]
    if "held-out" in recipe.kind:
        return float(config["held_out"])
    first = recipe.params.get("order", [""])[0]
    return config["episodes"] * float(config.get("first_weights", {}).get(first, 1.0))


def _skill_limit(spec: Spec, method: str) -> int:
    """Most steps of one skill of a method: its own limit, or the task's where it has none."""
    return method_rollout(method, spec.rollout).skill_limit or spec.step_limit


def _steps_in_tree(plan: Plan) -> int:
    """Most steps the tree can take: a limit of a skill's at each node, or of a task's on each path.

    A leaf's path shares its steps with its siblings'; counting a whole task's limit at every leaf,
    and nothing above it, bounds the sum.
    """
    spec = plan.spec
    by_limit: dict[int, list[Node]] = {}
    for node in plan.nodes:
        by_limit.setdefault(_skill_limit(spec, node.method), []).append(node)
    return spec.episodes * sum(
        min(sum(node not in plan.children for node in nodes) * spec.step_limit, len(nodes) * limit)
        for limit, nodes in by_limit.items()
    )


def _training_history(store: Store) -> dict[str, float]:
    """Seconds that artifacts took before on this machine's store, by their likeness.

    The longest, which is what to expect where other work runs beside it.
    """
    recipes: dict[str, Recipe] = {}
    seconds: dict[str, float] = {}
    for kind, key in store.artifacts():
        try:
            made = store.manifest(kind, key)["made"]
        except CorruptArtifactError:
            continue
        recipes[key] = Recipe(made["kind"], made["params"], made["inputs"])
        seconds[key] = made["seconds"]
    likeness = Likeness(recipes)
    longest: dict[str, float] = {}
    for key, taken in seconds.items():
        alike = likeness.of(key)
        longest[alike] = max(taken, longest.get(alike, 0.0))
    return longest

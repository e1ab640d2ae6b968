"""What a plan says before anything runs: found, missing, decided."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from orchestrator.printing import plan_lines
from orchestrator.spec.spec import Spec
from orchestrator.storage.ledger import Ledger, Outcome, PlayCounts
from orchestrator.storage.store import Artifact, Store
from orchestrator.work.costs import estimate, standings
from orchestrator.work.plan import Node, Plan, make_plan
from tests.orchestrator.tiny import tiny_spec


@pytest.fixture(scope="module")
def spec() -> Spec:
    return tiny_spec()


@pytest.fixture(scope="module")
def plan(spec: Spec) -> Plan:
    return make_plan(spec)


@pytest.fixture
def shared(tmp_path: Path) -> Iterator[Ledger]:
    ledger = Ledger(tmp_path / "blocks.sqlite")
    yield ledger
    ledger.close()


def finish(shared: Ledger, plan: Plan, node: Node, survivors: int) -> None:
    success = np.arange(plan.spec.episodes) < survivors
    for chunk, _ in enumerate(plan.chunks):
        outcome = Outcome({"success": success})
        shared.record([(plan.tasks[node, chunk].key, outcome.to_bytes())])


def test_an_empty_store_finds_nothing(plan: Plan, shared: Ledger, tmp_path: Path) -> None:
    costs = estimate(plan, Store(tmp_path), shared)
    assert sum(missing for _, missing in costs.artifacts.values()) == len(plan.recipes)
    assert sum(sum(counts.values()) for counts in costs.blocks.values()) == len(plan.tasks)
    assert all(set(counts) == {"missing"} for counts in costs.blocks.values())
    assert costs.seconds_training > 0
    assert costs.seconds_evaluation > 0


def test_what_nobody_survived_to_is_decided(plan: Plan, shared: Ledger) -> None:
    dead, alive = (Node(0, "", (skill,)) for skill in plan.spec.skill_names[:2])
    finish(shared, plan, dead, survivors=0)
    finish(shared, plan, alive, survivors=1)
    places = standings(plan, shared, {})
    standing = {(place.node, place.task.key): place.standing for place in places}
    assert len(standing) == len(plan.tasks)
    for (node, _), state in standing.items():
        below_dead = node.seed == 0 and node.prefix[0] == dead.prefix[0]
        if node in (dead, alive):
            assert state == "found"
        elif below_dead:
            assert state == "decided"
        else:
            assert state == "missing"


def test_found_artifacts_cost_nothing(plan: Plan, shared: Ledger, tmp_path: Path) -> None:
    store = Store(tmp_path)
    before = estimate(plan, store, shared)
    key, recipe = next(iter(plan.recipes.items()))
    made = {"kind": recipe.kind, "params": recipe.params, "inputs": {}, "seconds": 1.0}
    store.write(recipe.kind, key, Artifact({}, {}), made)
    after = estimate(plan, store, shared)
    assert after.artifacts[recipe.kind] == (1, before.artifacts[recipe.kind][1] - 1)
    assert after.seconds_training < before.seconds_training


def test_times_come_from_this_stores_history(plan: Plan, shared: Ledger, tmp_path: Path) -> None:
    for kind in {task.kind for task in plan.tasks.values()}:
        shared.add_played(kind, PlayCounts(segments=10, successes=10, seconds=20.0))
    costs = estimate(plan, Store(tmp_path), shared)
    assert costs.from_history
    assert costs.seconds_evaluation == pytest.approx(2.0 * costs.segments_in_tree)


def test_survivors_are_expected_as_they_were_before(
    plan: Plan, shared: Ledger, tmp_path: Path
) -> None:
    """Half survive each skill: half of the second skills are played."""
    for kind in {task.kind for task in plan.tasks.values()}:
        shared.add_played(kind, PlayCounts(segments=10, successes=5, seconds=10.0))
    first = sum(node.parent is None for node in plan.nodes)
    second = len(plan.nodes) - first
    costs = estimate(plan, Store(tmp_path), shared)
    assert costs.segments_missing == plan.spec.episodes * (first + second / 2)
    assert costs.seconds_evaluation == pytest.approx(costs.segments_missing)


@pytest.fixture(scope="module")
def first_stitch(spec: Spec) -> Plan:
    return make_plan(replace(spec, rollout=replace(spec.rollout, first_stitch=True)))


def test_first_skills_that_are_stitched_to_are_their_method_s(
    first_stitch: Plan, shared: Ledger, tmp_path: Path
) -> None:
    """In counts, and in how often they were seen to succeed."""
    spec = first_stitch.spec
    for kind, successes in {"any method": 10, "mb-stitch": 5}.items():
        name = f"{spec.benchmark}, {kind}, skill 1"
        shared.add_played(name, PlayCounts(segments=10, successes=successes, seconds=10.0))
    costs = estimate(first_stitch, Store(tmp_path), shared)
    blocks = len(first_stitch.chunks) * spec.seeds * len(spec.skill_names)
    assert costs.blocks[""] == {"missing": blocks}
    own = costs.blocks["mb-stitch"]["missing"]
    assert own == costs.blocks["random-stitch"]["missing"]
    assert own == costs.blocks["no-stitch"]["missing"] + blocks
    arriving = {
        place.node.method: place.arriving
        for place in standings(first_stitch, shared, shared.history())
        if len(place.node.prefix) == 2
    }
    assert arriving["no-stitch"] == arriving["mf-stitch"] == 2 * arriving["mb-stitch"]


def test_a_plan_says_how_many_first_skills_are_shared(
    first_stitch: Plan, shared: Ledger, tmp_path: Path
) -> None:
    for methods, there in ((first_stitch.spec.methods, True), (("mb-stitch",), False)):
        plan = make_plan(replace(first_stitch.spec, methods=methods))
        costs = estimate(plan, Store(tmp_path), shared)
        text = "\n".join(plan_lines(plan.spec, costs, workers=2))
        assert ("first skills, shared" in text) == there


def test_the_plan_is_printed_for_a_person(plan: Plan, shared: Ledger, tmp_path: Path) -> None:
    costs = estimate(plan, Store(tmp_path), shared)
    text = "\n".join(plan_lines(plan.spec, costs, workers=2))
    for word in ("agent", "MB-Stitch", "first skills", "decided", "on 2", "disk"):
        assert word in text

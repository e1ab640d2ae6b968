"""What a plan says before anything runs: found, missing, decided."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from orchestrator.costs.estimate import CostEstimate, estimate, standings
from orchestrator.costs.expectations import Expectations
from orchestrator.printing import plan_lines, suite_plan_lines
from orchestrator.spec.methods import SHARED
from orchestrator.spec.spec import Spec, TableSpec, load_spec, spec_from_plain
from orchestrator.spec.structure import Plain, merged, to_plain
from orchestrator.spec.suite import Part, Suite
from orchestrator.storage.ledger import Ledger, Outcome, PlayCounts
from orchestrator.storage.store import Artifact, Store
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
    places = standings(plan, shared, Expectations(plan, {}))
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


def played(shared: Ledger, plan: Plan, counts: PlayCounts) -> None:
    """As if a block of every kind of this plan had been played."""
    expected = Expectations(plan, {})
    for kind in {expected.kind(*place) for place in plan.tasks}:
        shared.add_played(kind, counts)


def test_times_come_from_this_stores_history(plan: Plan, shared: Ledger, tmp_path: Path) -> None:
    assert estimate(plan, Store(tmp_path), shared).seconds_measured == 0
    played(shared, plan, PlayCounts(segments=10, successes=10, seconds=20.0))
    costs = estimate(plan, Store(tmp_path), shared)
    assert costs.seconds_measured == costs.seconds_evaluation
    assert costs.seconds_evaluation == pytest.approx(2.0 * costs.segments_in_tree)
    assert "measured in this store, the rest counted" in "\n".join(plan_lines(plan.spec, costs, 2))


def trained(store: Store, plan: Plan, seconds: float) -> None:
    """As if every artifact of this plan had been made."""
    for key, recipe in plan.recipes.items():
        made = {"kind": recipe.kind, "params": recipe.params, "inputs": recipe.inputs}
        store.write(recipe.kind, key, Artifact({}, {}), made | {"seconds": seconds})


DIFFERENT = {
    "data": {"data": {"noise": 0.01}},
    "agent": {"agent": {"gamma": 0.9}},
    "updates": {"agent": {"updates": 61}},
    "rollout": {"rollout": {"temperature": 0.5}},
    "episodes that step together": {"episodes": 3, "block_episodes": 3},
}


@pytest.mark.parametrize("changes", DIFFERENT.values(), ids=DIFFERENT)
def test_history_counts_only_where_everything_is_alike(
    changes: Plain, spec: Spec, plan: Plan, shared: Ledger, tmp_path: Path
) -> None:
    """So a smoke run tells nothing of the paper's scale."""
    played(shared, plan, PlayCounts(segments=10, successes=10, seconds=1e6))
    trained(Store(tmp_path), plan, 1e6)
    other = make_plan(spec_from_plain(merged(to_plain(spec), changes), "other"))
    costs = estimate(other, Store(tmp_path), shared)
    assert costs.seconds_evaluation < 1e5
    assert costs.seconds_training < 1e5


def test_history_is_of_its_method_s_settings(spec: Spec, shared: Ledger, tmp_path: Path) -> None:
    before = make_plan(replace(spec, methods=("mb-stitch",)))
    played(shared, before, PlayCounts(segments=10, successes=10, seconds=1e6))
    own = {"mb-stitch[alpha=1]": 1e5, "mb-stitch[random_shooting.population=20]": 1e5}
    for method, most in own.items():
        plan = make_plan(replace(spec, methods=(method,)))
        costs = estimate(plan, Store(tmp_path), shared)
        firsts = sum(node.parent is None for node in plan.nodes) * spec.episodes * 1e5
        assert 0 < costs.seconds_evaluation - firsts < most


def test_other_seeds_are_alike(spec: Spec, plan: Plan, shared: Ledger, tmp_path: Path) -> None:
    store = Store(tmp_path)
    played(shared, plan, PlayCounts(segments=10, successes=10, seconds=20.0))
    trained(store, plan, 7.0)
    other = make_plan(replace(spec, root_seed=1))
    costs = estimate(other, store, shared)
    assert costs.seconds_evaluation == pytest.approx(2.0 * costs.segments_in_tree)
    assert costs.seconds_training == 7.0 * sum(missing for _, missing in costs.artifacts.values())
    assert "(measured in this store)" in "\n".join(plan_lines(other.spec, costs, 2))


def test_parts_that_share_artifacts_have_the_history_of_these(
    spec: Spec, plan: Plan, shared: Ledger, tmp_path: Path
) -> None:
    """A part's own artifacts and blocks come from what another part has counted already."""
    store = Store(tmp_path)
    played(shared, plan, PlayCounts(segments=10, successes=10, seconds=20.0))
    trained(store, plan, 7.0)
    others = replace(spec, root_seed=1)
    specs = {"first": replace(others, methods=("no-stitch",)), "second": others}
    parts = tuple(Part(label, each) for label, each in specs.items())
    suite = Suite("two", "Two parts", "smoke", parts, (TableSpec("two", "", rows="variant"),))
    *lines, time, _ = suite_plan_lines(suite, tmp_path, 1)
    assert time.endswith("(measured in this store)")
    again = len({*make_plan(specs["first"]).recipes} & {*make_plan(others).recipes})
    assert f"part second, with {again} artifacts of parts above" in lines
    costs = estimate(make_plan(others), store, shared, counted=make_plan(specs["first"]).recipes)
    missing = sum(missing for _, missing in costs.artifacts.values())
    assert missing == len(make_plan(others).recipes) - again
    assert costs.seconds_training == 7.0 * missing


@pytest.fixture(scope="module")
def paper() -> Spec:
    return replace(load_spec("table1"), methods=("no-stitch", "mb-stitch"))


LARGER = {
    "width": ({"agent": {"width": 16384}}, 1e3, 1),
    "members": ({"agent": {"members": 1000}}, 50, 1),
    "batch": ({"agent": {"batch_size": 64_000}}, 10, 1),
    "layers": ({"dynamics": {"hidden_layers": 100}}, 2, 1),
    "population": ({"mb_stitch": {"random_shooting": {"population": 10**6}}}, 1, 10),
    "imagined": ({"dynamics": {"width": 4096}}, 100, 100),
}


@pytest.mark.parametrize(("changes", "training", "playing"), LARGER.values(), ids=LARGER)
def test_what_is_larger_is_expected_to_take_longer(
    changes: Plain,
    training: float,
    playing: float,
    paper: Spec,
    shared: Ledger,
    tmp_path: Path,
) -> None:
    def costs_of(plan: Plan) -> CostEstimate:
        return estimate(plan, Store(tmp_path), shared)

    usual = costs_of(make_plan(paper))
    large = costs_of(make_plan(spec_from_plain(merged(to_plain(paper), changes), "large")))
    assert large.seconds_training >= training * usual.seconds_training
    assert large.seconds_evaluation >= playing * usual.seconds_evaluation


def test_wide_networks_fill_the_disk(paper: Spec, shared: Ledger, tmp_path: Path) -> None:
    plan = make_plan(paper)
    wide = make_plan(replace(paper, agent=replace(paper.agent, width=16384)))
    assert estimate(plan, Store(tmp_path), shared).disk_bytes < 10**8
    assert estimate(wide, Store(tmp_path), shared).disk_bytes > 10**10


def test_survivors_are_expected_as_they_were_before(
    plan: Plan, shared: Ledger, tmp_path: Path
) -> None:
    """Half survive each skill: half of the second skills are played."""
    played(shared, plan, PlayCounts(segments=10, successes=5, seconds=10.0))
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
    expected = Expectations(first_stitch, {})
    kinds = {
        expected.kind(node, chunk): 10 if node.method == SHARED else 5
        for node, chunk in first_stitch.tasks
        if node.method in (SHARED, "mb-stitch") and node.parent is None
    }
    for kind, successes in kinds.items():
        shared.add_played(kind, PlayCounts(segments=10, successes=successes, seconds=10.0))
    costs = estimate(first_stitch, Store(tmp_path), shared)
    blocks = len(first_stitch.chunks) * spec.seeds * len(spec.skill_names)
    assert costs.blocks[""] == {"missing": blocks}
    own = costs.blocks["mb-stitch"]["missing"]
    assert own == costs.blocks["random-stitch"]["missing"]
    assert own == costs.blocks["no-stitch"]["missing"] + blocks
    arriving = {
        place.node.method: place.arriving
        for place in standings(first_stitch, shared, Expectations(first_stitch, shared.history()))
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

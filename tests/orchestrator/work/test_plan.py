"""The plan: every prefix once, first skills shared, and a change re-plays only what it touches."""

import importlib.util
from dataclasses import replace
from itertools import permutations
from typing import TypedDict, get_args

import pytest

from orchestrator.benchmarks.registry import BENCHMARKS
from orchestrator.builders.models import LOADERS
from orchestrator.builders.registry import BLOCK_CODE, BLOCK_SETUP, BUILDERS
from orchestrator.errors import UsageError
from orchestrator.spec.methods import first_method, playing_modules
from orchestrator.spec.spec import Spec, load_spec
from orchestrator.work.artifacts import MODELS
from orchestrator.work.plan import MOST_BLOCKS, Node, Plan, make_plan
from orchestrator.work.recipes import _closure
from stitching.data.mixtures import Mixture
from stitching.envs.kitchen import KITCHEN
from stitching.envs.maze import MAZE
from stitching.methods.mb_stitch import MBStitchSettings
from stitching.rollout import RolloutConfig
from tests.sections import section, with_sections


@pytest.fixture(scope="module")
def spec() -> Spec:
    return load_spec("table1")


@pytest.fixture(scope="module")
def plan(spec: Spec) -> Plan:
    return make_plan(spec)


def block_keys(plan: Plan) -> dict[tuple[Node, int], str]:
    return {place: task.key for place, task in plan.tasks.items()}


def changed(before: Plan, after: Plan) -> set[Node]:
    ours, theirs = block_keys(before), block_keys(after)
    assert ours.keys() == theirs.keys()
    return {node for (node, chunk), key in ours.items() if theirs[node, chunk] != key}


def test_nodes_are_the_prefixes_of_all_tasks(plan: Plan, spec: Spec) -> None:
    prefixes = [p for n in (2, 3, 4) for p in permutations(spec.skill_names, n)]
    expected = {Node(seed, "", (skill,)) for seed in range(3) for skill in spec.skill_names}
    expected |= {
        Node(seed, method, prefix)
        for seed in range(3)
        for method in spec.methods
        for prefix in prefixes
    }
    assert len(plan.nodes) == len(set(plan.nodes)) == 3 * (4 + 4 * 60)
    assert set(plan.nodes) == expected


FIRST = RolloutConfig(first_stitch=True)


def test_first_skills_that_are_stitched_to_belong_to_their_method(spec: Spec) -> None:
    """No-Stitch and MF-Stitch, which has no pair there, share one."""
    firsts = [node for node in make_plan(replace(spec, rollout=FIRST)).nodes if not node.parent]
    owners = ("", "random-stitch", "mb-stitch")
    assert {(node.method, node.prefix) for node in firsts} == {
        (method, (skill,)) for method in owners for skill in spec.skill_names
    }


@pytest.mark.parametrize("rollout", [RolloutConfig(), FIRST])
def test_parents_come_first(spec: Spec, rollout: RolloutConfig) -> None:
    seen: set[Node] = set()
    for node in make_plan(replace(spec, rollout=rollout)).nodes:
        if node.parent is None:
            assert len(node.prefix) == 1
        else:
            assert node.parent in seen
            assert node.parent.prefix == node.prefix[:-1]
            shared = first_method(node.method, rollout) == ""
            assert node.parent.method == ("" if shared and len(node.prefix) == 2 else node.method)
        seen.add(node)


def test_artifacts_come_after_their_inputs(plan: Plan) -> None:
    kinds = [recipe.kind for recipe in plan.recipes.values()]
    assert {kind: kinds.count(kind) for kind in set(kinds)} == {
        "maze-demonstrations": 1,
        "maze-exploration": 1,
        "agent": 3,
        "dynamics": 3,
        "mf-policy": 3,
        "maze-showcase": 1,
    }
    seen: set[str] = set()
    for key, recipe in plan.recipes.items():
        assert set(recipe.inputs.values()) <= seen
        seen.add(key)


def test_episodes_are_cut_into_blocks(spec: Spec) -> None:
    plan = make_plan(replace(spec, episodes=25, block_episodes=10))
    assert plan.chunks == [(0, 10), (10, 20), (20, 25)]
    assert len(plan.tasks) == 3 * len(plan.nodes)


def test_plans_are_the_same_every_time(plan: Plan, spec: Spec) -> None:
    again = make_plan(spec)
    assert block_keys(again) == block_keys(plan)
    assert list(again.recipes) == list(plan.recipes)
    assert len(set(block_keys(plan).values())) == len(plan.tasks)


def test_alpha_touches_first_skills_only_where_they_are_stitched_to(spec: Spec) -> None:
    spec = replace(spec, rollout=FIRST)
    plan = make_plan(spec)
    other = make_plan(with_sections(spec, replace(section(spec, MBStitchSettings), alpha=5.0)))
    touched = changed(plan, other)
    assert touched == {node for node in plan.nodes if node.method == "mb-stitch"}
    assert {node.prefix for node in touched if not node.parent} == {
        (skill,) for skill in spec.skill_names
    }


def test_alpha_touches_only_mb_stitch_after_the_first_skill(plan: Plan, spec: Spec) -> None:
    other = make_plan(with_sections(spec, replace(section(spec, MBStitchSettings), alpha=5.0)))
    assert changed(plan, other) == {node for node in plan.nodes if node.method == "mb-stitch"}
    differing = set(plan.recipes) - set(other.recipes)
    assert {plan.recipes[key].kind for key in differing} == {"maze-showcase"}


def test_the_dynamics_touch_only_what_plans_with_them(plan: Plan, spec: Spec) -> None:
    other = make_plan(replace(spec, dynamics=replace(spec.dynamics, updates=10)))
    assert changed(plan, other) == {node for node in plan.nodes if node.method == "mb-stitch"}


def test_the_agent_touches_everything(plan: Plan, spec: Spec) -> None:
    other = make_plan(replace(spec, agent=replace(spec.agent, updates=10)))
    assert changed(plan, other) == set(plan.nodes)


def test_more_seeds_methods_or_tasks_touch_nothing(plan: Plan, spec: Spec) -> None:
    fewer = make_plan(replace(spec, seeds=1, methods=("mb-stitch",), lengths=(2, 3)))
    theirs = block_keys(plan)
    assert all(theirs[place] == key for place, key in block_keys(fewer).items())
    assert set(fewer.recipes) - set(fewer.illustrations.values()) < set(
        plan.recipes
    )  # it shows other methods


@pytest.mark.parametrize(
    ("method", "own", "others"),
    [
        ("no-stitch", ["methods.no_stitch"], ["methods.random_stitch", "planning.cem"]),
        (
            "mb-stitch",  # with random shooting here
            ["methods.mb_stitch", "methods.planning", "planning.objective", "models.dynamics",
             "planning.random_shooting"],
            ["planning.cem", "methods.random_stitch", "methods.reach_stitch"],
        ),
        ("single-policy", ["methods.single_policy", "methods.no_stitch"], ["methods.mb_stitch"]),
    ],
)  # fmt: skip
def test_blocks_are_named_by_the_code_that_plays_them(
    spec: Spec, method: str, own: list[str], others: list[str]
) -> None:
    """By all of it: a list that somebody keeps would let an edit reuse stale results."""
    played = _closure((*BLOCK_CODE, *playing_modules(method, spec.method_settings(method))))
    assert {f"stitching.{name}" for name in (*own, "rollout", "envs.first_times")} <= played
    assert not {f"stitching.{name}" for name in others} & played
    assert all(importlib.util.find_spec(module) for module in BLOCK_SETUP)


def test_settings_without_effect_name_nothing(spec: Spec, plan: Plan) -> None:
    method = "mb-stitch[cem.horizon=9]"  # under random shooting
    other = make_plan(replace(spec, methods=("no-stitch", method)))
    theirs = {(node.seed, node.prefix): task.key for (node, _), task in other.tasks.items()
              if node.method == method}  # fmt: skip
    ours = {(node.seed, node.prefix): task.key for (node, _), task in plan.tasks.items()
            if node.method == "mb-stitch"}  # fmt: skip
    assert theirs
    assert theirs == {place: ours[place] for place in theirs}
    with pytest.raises(UsageError, match="are the same method"):
        replace(spec, methods=("mb-stitch", method))


def test_what_can_be_read_can_be_made() -> None:
    assert MODELS.keys() == LOADERS.keys() <= BUILDERS.keys()


def test_only_a_fine_tuned_stitch_depends_on_the_agent(spec: Spec) -> None:
    """And each reading of the mixed data is another artifact."""
    mixtures = get_args(Mixture)
    methods = tuple(f"mf-stitch[mixture={mixture}]" for mixture in mixtures)
    plan = make_plan(replace(spec, methods=methods, seeds=1))
    made = [plan.models["mf-policy", 0, method] for method in methods]
    assert len(set(made)) == len(mixtures)
    for mixture, key in zip(mixtures, made, strict=True):
        inputs = plan.recipes[key].inputs
        assert ("agent" in inputs) == (mixture == "fine-tuned")
        assert "demonstrations" in inputs


def test_settings_in_a_methods_name_are_settings(spec: Spec) -> None:
    plain = make_plan(replace(spec, methods=("mb-stitch",)))
    named = make_plan(replace(spec, methods=("mb-stitch[alpha=20]",)))
    assert sorted(block_keys(plain).values()) == sorted(block_keys(named).values())


def test_the_order_of_methods_does_not_choose_the_picture(spec: Spec) -> None:
    one, other = (
        make_plan(replace(spec, methods=methods))
        for methods in (
            ("no-stitch", "mb-stitch"),
            ("mb-stitch", "mb-stitch[selective=true]", "no-stitch"),
        )
    )
    shown, same = (plan.recipes[plan.illustrations["showcase"]] for plan in (one, other))
    assert shown == same
    assert [method for method, _ in shown.params["methods"]] == ["no-stitch", "mb-stitch"]


def test_the_registry_names_the_environments_that_data_are_made_in() -> None:
    """Whose code is in the datasets' names, and so in all that is learned from them."""
    assert {"maze": MAZE, "kitchen": KITCHEN}.items() <= BENCHMARKS.items()


def test_no_score_depends_on_what_is_only_looked_at(plan: Plan) -> None:
    made = {recipe.kind for recipe in plan.recipes.values()}
    assert made - plan.scored_kinds == {"maze-showcase"}


def test_initiation_sets_are_of_the_data_alone(spec: Spec) -> None:
    plan = make_plan(replace(spec, methods=("no-stitch", "reach-stitch")))
    key = plan.by_seed("initiation-sets")[0]
    assert set(plan.by_seed("initiation-sets").values()) == {key}
    assert plan.recipes[key].inputs == plan.recipes[plan.by_seed("agent")[0]].inputs
    other = replace(spec, methods=("reach-stitch",), agent=replace(spec.agent, width=7), seeds=1)
    assert make_plan(other).by_seed("initiation-sets") == {0: key}
    assert key in plan.needed
    assert not make_plan(spec).by_seed("initiation-sets")


class Altered(TypedDict, total=False):
    swap: float
    corrections: float


@pytest.mark.parametrize("setting", [{"swap": 0.8}, {"corrections": 1.5}], ids=str)
def test_what_belongs_together_names_an_agent_that_alters_it(setting: Altered) -> None:
    kitchen = load_spec("table2", "smoke")
    altered = make_plan(replace(kitchen, agent=replace(kitchen.agent, **setting)))
    agent = altered.recipes[altered.by_seed("agent")[0]]
    assert agent.params["factors"]["own"]["kettle"] == "kettle"
    usual = make_plan(kitchen)
    assert "factors" not in usual.recipes[usual.by_seed("agent")[0]].params


@pytest.mark.parametrize(
    "changes",
    [{"episodes": 100_000, "block_episodes": 1}, {"seeds": 1000, "episodes": 1000}],
    ids=["small blocks", "many seeds"],
)
def test_more_blocks_than_fit_are_refused_unexpanded(spec: Spec, changes: dict[str, int]) -> None:
    with pytest.raises(UsageError, match=r"spec table1: [\d,]+ blocks, .* ask for larger block_ep"):
        make_plan(replace(spec, **changes))  # type: ignore[arg-type]


def test_the_largest_plans_of_the_paper_s_tables_are_small() -> None:
    for name in ("table1", "table2", "table3-door"):
        plan = make_plan(load_spec(name))
        assert 5 * len(plan.nodes) * len(plan.chunks) < MOST_BLOCKS


def test_a_block_alone_is_called_as_among_all(plan: Plan) -> None:
    for place in (*list(plan.tasks)[:3], *list(plan.tasks)[-3:]):
        assert plan.task(*place) == plan.tasks[place]

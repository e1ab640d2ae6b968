"""Single-Policy in a plan: its own data, policy and nodes; Table 4 shares the rest with Table 2."""

from dataclasses import replace

import pytest

from analysis.paper.numbers import paper_table
from orchestrator.benchmarks.registry import ENTRIES
from orchestrator.errors import UsageError
from orchestrator.spec.spec import Spec, load_spec
from orchestrator.spec.tomls import Scale
from orchestrator.storage.claim import describe
from orchestrator.work.plan import Plan, make_plan
from stitching.methods.mb_stitch import MBStitchSettings
from stitching.methods.single_policy import SinglePolicySettings
from tests.sections import section, with_sections

METHOD = "single-policy"


@pytest.fixture(scope="module")
def spec() -> Spec:
    return load_spec("table4", "quick")


@pytest.fixture(scope="module")
def plan(spec: Spec) -> Plan:
    return make_plan(spec)


def test_table4_has_the_papers_rows(spec: Spec) -> None:
    rows = dict.fromkeys(paper_table("4")["row"])
    assert [" → ".join(task) for task in spec.all_tasks] == list(rows)
    assert (spec.step_limits[1], spec.methods) == (spec.rollout.skill_limit, (METHOD, "mb-stitch"))


@pytest.mark.parametrize("scale", ["smoke", "quick", "standard", "paper"])
def test_the_skills_and_the_dynamics_are_table_2s(scale: Scale) -> None:
    ours, theirs = (make_plan(load_spec(name, scale)) for name in ("table4", "table2"))
    for kind in ("agent", "dynamics"):
        assert ours.by_seed(kind) == theirs.by_seed(kind)
    assert section(ours.spec, MBStitchSettings) == section(theirs.spec, MBStitchSettings)


@pytest.mark.parametrize("scale", ["quick", "standard"])
def test_the_stitched_blocks_are_table_2s(scale: Scale) -> None:
    """They are played once for both tables."""
    ours, theirs = (
        make_plan(replace(load_spec(name, scale), methods=("mb-stitch",))).tasks
        for name in ("table4", "table2")
    )
    found = {place: theirs[place].key for place in ours}
    assert {place: task.key for place, task in ours.items()} == found


def test_its_nodes_are_its_own_from_the_first_skill_on(spec: Spec, plan: Plan) -> None:
    own = [node for node in plan.nodes if node.method == METHOD]
    assert {node.prefix for node in own} == {
        task[:depth] for task in spec.all_tasks for depth in range(1, len(task) + 1)
    }
    assert all(node.parent is None or node.parent.method == METHOD for node in own)
    methods = describe(spec)["methods"]
    assert {method["name"] for method in methods if method["own_first_skill"]} >= {METHOD}


def test_it_is_played_by_its_policy_alone_to_the_tasks_limit(plan: Plan) -> None:
    for (node, _), task in plan.tasks.items():
        if node.method == METHOD:
            assert task.artifacts == {METHOD: plan.by_seed(METHOD)[node.seed]}
            assert task.rollout.skill_limit == 0
        else:
            assert task.rollout.skill_limit == plan.spec.rollout.skill_limit


def test_its_demonstrations_teach_it_and_nothing_else(plan: Plan) -> None:
    role = f"demonstrations of {METHOD}"
    policy = plan.recipes[plan.by_seed(METHOD)[0]]
    assert list(policy.inputs.values()) == [plan.datasets[role]]
    params = plan.recipes[plan.datasets[role]].params
    assert ">".join(params["order"]) == section(plan.spec, SinglePolicySettings).task
    skills = plan.recipes[plan.datasets["demonstrations-microwave-top-hinge-slide"]].params
    episodes = section(plan.spec, SinglePolicySettings).episodes
    assert params["config"] == skills["config"] | {"episodes": episodes}
    others = {*plan.by_seed("agent").values(), *plan.by_seed("dynamics").values()}
    assert not any(plan.datasets[role] in plan.recipes[key].inputs.values() for key in others)


def test_its_settings_touch_it_alone(spec: Spec, plan: Plan) -> None:
    fewer = make_plan(replace(spec, methods=("single-policy[episodes=60]", "mb-stitch")))
    assert fewer.by_seed(METHOD) != plan.by_seed(METHOD)
    assert set(plan.recipes) - set(fewer.recipes) == {
        *plan.by_seed(METHOD).values(), plan.datasets[f"demonstrations of {METHOD}"]
    }  # fmt: skip


def test_alone_it_needs_no_skills(spec: Spec) -> None:
    plan = make_plan(replace(spec, methods=(METHOD,)))
    kinds = {recipe.kind for recipe in plan.recipes.values()}
    assert kinds == plan.scored_kinds == {"kitchen-long-horizon", METHOD}
    assert plan.needed == set(plan.recipes)


def test_what_cannot_be_demonstrated_is_refused(spec: Spec) -> None:
    for task in ("", "microwave>microwave", "microwave>stove"):
        with pytest.raises(UsageError, match="is no task; join skills by '>'"):
            with_sections(spec, replace(section(spec, SinglePolicySettings), task=task))
    with pytest.raises(UsageError, match="these data of maze demonstrate no long task"):
        replace(load_spec("table1", "smoke"), methods=(METHOD,))
    people = replace(spec.data, source="human", human="D4RL/kitchen/complete-v2")
    assert ENTRIES["kitchen"].long_horizon(people) == ""

"""What benchmarks bring along: datasets by source, and labels of unusual data."""

from dataclasses import replace

import pytest

from orchestrator.benchmarks.registry import ENTRIES
from orchestrator.builders.registry import BUILDERS
from orchestrator.spec.spec import Spec, load_spec
from orchestrator.storage.claim import describe
from orchestrator.work.plan import Plan, make_plan
from stitching.data.kitchen.demonstrations import KitchenDataConfig
from stitching.envs.kitchen import SKILLS
from stitching.methods.mb_stitch import MBStitchSettings
from stitching.planning.cem import CEM
from tests.sections import section


@pytest.fixture(scope="module")
def spec() -> Spec:
    return load_spec("table2", "quick")


@pytest.fixture(scope="module")
def plan(spec: Spec) -> Plan:
    return make_plan(spec)


def test_every_kind_of_every_kit_can_be_made() -> None:
    for entry in ENTRIES.values():
        kinds = {one.kind for one in entry.datasets(entry.data()).values()}
        kinds |= {one.kind for one in entry.illustrations.values()} | set(entry.extras.values())
        kinds |= {entry.long_horizon(entry.data())} - {""}
        assert kinds <= BUILDERS.keys()


def test_table2_is_the_papers_protocol() -> None:
    spec = load_spec("table2")
    lengths = [len(task) for task in spec.all_tasks]
    assert [lengths.count(n) for n in (2, 3, 4)] == [42, 210, 840]
    assert (spec.episodes, spec.seeds, len(spec.methods)) == (100, 3, 4)
    assert spec.step_limits == {2: 250, 3: 360, 4: 480}
    # No shorter limit can bind before the skills' own, so all lengths share one tree exactly.
    assert all(limit >= n * spec.rollout.skill_limit for n, limit in spec.step_limits.items())
    settings = section(spec, MBStitchSettings)
    cem = section(settings, CEM)
    assert (cem.population, cem.elites, cem.horizon, cem.iterations) == (50, 10, 5, 500)
    assert (cem.momentum, cem.temperature, cem.temperature_discount) == (0.9, 0.5, 0.99)
    assert (settings.alpha, settings.beta, settings.execute) == (7.0, 5.0, 1)
    assert spec.dynamics.activation == "elu"


def test_kitchen_data_are_collected_an_order_at_a_time(spec: Spec) -> None:
    plan = make_plan(replace(spec, data=replace(spec.data, first_weights={})))
    assert len(plan.datasets) == 24
    agent = plan.recipes[plan.by_seed("agent")[0]]
    assert agent.inputs == plan.datasets == plan.recipes[plan.by_seed("dynamics")[0]].inputs
    orders = [tuple(plan.recipes[key].params["order"]) for key in plan.datasets.values()]
    assert len(set(orders)) == 24


def test_orders_without_demonstrations_have_no_dataset(plan: Plan) -> None:
    firsts = [plan.recipes[key].params["order"][0] for key in plan.datasets.values()]
    assert sorted(firsts) == ["bottom burner"] * 2 + ["microwave"] * 14  # none begins with kettle


def test_nothing_is_trained_on_held_out_data(plan: Plan) -> None:
    held_out = {key for key, recipe in plan.recipes.items() if recipe.kind == "kitchen-held-out"}
    assert len(held_out) == 1
    assert not held_out & plan.needed


def test_more_held_out_data_retrain_nothing(spec: Spec, plan: Plan) -> None:
    more = make_plan(replace(spec, data=replace(spec.data, held_out=20)))
    assert more.needed == plan.needed
    assert more.illustrations["diagnosis"] != plan.illustrations["diagnosis"]
    assert more.illustrations["showcase"] == plan.illustrations["showcase"]


def test_stitches_are_taken_apart_between_pairs_from_all_over_the_tasks(plan: Plan) -> None:
    recipe = plan.recipes[plan.illustrations["stitches"]]
    pairs = [tuple(pair) for pair in recipe.params["pairs"]]
    assert len(set(pairs)) == len(pairs) == 20
    assert {first for first, _ in pairs} == {second for _, second in pairs} == set(SKILLS)
    assert [method for method, _ in recipe.params["methods"]] == ["mb-stitch"]
    models = {"agent": plan.by_seed("agent")[0], "dynamics": plan.by_seed("dynamics")[0]}
    assert recipe.inputs == plan.datasets | models  # what distances are measured to
    assert recipe.key not in plan.needed


def test_few_pairs_are_all_taken_apart() -> None:
    plan = make_plan(load_spec("table3-can", "quick"))
    params = plan.recipes[plan.illustrations["stitches"]].params
    assert [tuple(pair) for pair in params["pairs"]] == [("can", "can")]
    assert params["episodes"] == 30


def test_other_sources_are_other_data_and_say_so(spec: Spec) -> None:
    single = replace(spec, data=KitchenDataConfig(source="single-skill"))
    assert list(make_plan(single).datasets) == [
        f"demonstrations-{name.split()[0]}" for name in SKILLS
    ]
    titles = [table["title"] for table in describe(single)["tables"]]
    assert all(title.endswith("(data: each skill alone, from the start pose)") for title in titles)
    assert not any("data:" in table["title"] for table in describe(spec)["tables"])

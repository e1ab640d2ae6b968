"""What a plan's datasets hold."""

from dataclasses import replace

from orchestrator.printing import data_lines
from orchestrator.spec.spec import Spec
from orchestrator.storage.datasets import datasets, undemonstrated_skills
from orchestrator.storage.store import Artifact
from orchestrator.work.plan import Plan, make_plan
from tests.orchestrator.tiny import Place


def test_each_dataset_says_what_it_accomplishes(finished: Place, plan: Plan) -> None:
    told = {dataset["name"]: dataset for dataset in datasets(plan, finished.store)}
    assert told["demonstrations"]["skills"] == dict.fromkeys(plan.spec.skill_names, 10)
    assert told["exploration"]["skills"] == {}
    assert undemonstrated_skills(plan, finished.store) == []
    assert not list(data_lines(plan, finished.store))


def test_a_skill_that_none_accomplishes_is_named(done: Place, plan: Plan, spec: Spec) -> None:
    key = plan.datasets["demonstrations"]
    kind = plan.recipes[key].kind
    real = done.store.read(kind, key)
    failed = real.arrays["episode_successes"] & (real.arrays["episode_skills"] != 2)
    done.store.discard(kind, key)
    done.store.write(
        kind, key, Artifact(real.arrays | {"episode_successes": failed}, real.info), {}
    )
    assert undemonstrated_skills(plan, done.store) == ["g2"]
    (line,) = data_lines(plan, done.store)
    assert line.startswith("No demonstration accomplishes g2:")
    others = replace(spec, tasks=("g0>g1", "g1>g0"))
    assert undemonstrated_skills(make_plan(others), done.store) == []


def test_a_plan_says_nothing_before_the_data_are_there(place: Place, plan: Plan) -> None:
    assert not list(data_lines(plan, place.store))

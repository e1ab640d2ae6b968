"""What every executor promises, shown on each."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

from orchestrator.executors import ExecutorKind, open_executor
from orchestrator.executors.protocol import Executor
from orchestrator.storage.ledger import Outcome
from orchestrator.storage.store import Artifact
from orchestrator.work.jobs import BlockTask, BuildJob, Job, PlayJob, Report
from orchestrator.work.plan import Plan
from orchestrator.work.recipes import Recipe
from tests.orchestrator.tiny import Place

KINDS = ["serial", pytest.param("ray", marks=pytest.mark.ray)]


@pytest.fixture(scope="module", params=KINDS)
def executor(request: pytest.FixtureRequest, plan: Plan, finished: Place) -> Iterator[Executor]:
    """One for the whole module: an executor must serve any sequence of jobs."""
    executor = opened(request.param, request)
    for key, recipe in plan.recipes.items():
        executor.provide(key, finished.store.read(recipe.kind, key))
    yield executor
    executor.close()


def opened(kind: ExecutorKind, request: pytest.FixtureRequest) -> Executor:
    if kind == "ray":
        request.getfixturevalue("shared_ray")
    return open_executor(kind, 2, None)


def work(job: Job) -> tuple[str, ...]:
    """What a job does: reports may carry a copy of it."""
    if isinstance(job, BuildJob):
        return (job.recipe.key,)
    return tuple(task.key for task, _ in job.tasks)


def reports(executor: Executor, jobs: list[Job]) -> list[Report]:
    """Every job's report, in the order of the jobs."""
    for job in jobs:
        executor.submit(job)
    found = {work(report.job): report for report in (executor.next() for _ in jobs)}
    assert found.keys() == {work(job) for job in jobs}
    return [found[work(job)] for job in jobs]


def roots(plan: Plan) -> list[BlockTask]:
    return [plan.tasks[node, chunk] for node in plan.roots() for chunk in range(len(plan.chunks))]


def alone(*tasks: BlockTask) -> list[Job]:
    return [PlayJob(((task, None),)) for task in tasks]


def test_builds(executor: Executor, plan: Plan, finished: Place) -> None:
    jobs: list[Job] = [BuildJob(recipe) for recipe in plan.recipes.values()]
    for report, (key, recipe) in zip(reports(executor, jobs), plan.recipes.items(), strict=True):
        assert report.trouble is None
        assert report.artifact is not None
        assert report.artifact.digest == finished.store.read(recipe.kind, key).digest
        assert report.seconds > 0


def test_plays(executor: Executor, plan: Plan, finished: Place) -> None:
    """More jobs than workers, first skills and stitched ones mixed, bundled or not."""
    ledger = finished.directory.ledger(read_only=True)
    played = {task.key: (node, chunk) for (node, chunk), task in plan.tasks.items()}
    recorded = dict(ledger.raw(played))
    pairs = []
    for key in recorded:
        node, chunk = played[key]
        task = plan.tasks[node, chunk]
        parent = None
        if node.parent is not None:
            parent = Outcome.from_bytes(recorded[plan.tasks[node.parent, chunk].key])
        pairs.append((task, parent))
    ledger.close()
    bundles = [pairs[i : i + 5] for i in range(0, len(pairs), 5)]
    jobs: list[Job] = [PlayJob(tuple(bundle)) for bundle in bundles]
    found = [block for report in reports(executor, jobs) for block in report.blocks]
    assert [block.key for block in found] == list(recorded)
    assert {block.key: block.outcome for block in found} == recorded
    assert sum(block.segments for block in found) == sum(
        len(Outcome.from_bytes(data).arrays["episode"]) for data in recorded.values()
    )
    singles = reports(executor, [PlayJob((pair,)) for pair in pairs[:7]])
    assert [report.blocks[0].outcome for report in singles] == list(recorded.values())[:7]


def test_building_after_playing_and_playing_after_building(executor: Executor, plan: Plan) -> None:
    play, build = alone(roots(plan)[0])[0], BuildJob(plan.recipes[plan.by_seed("agent")[0]])
    for report in reports(executor, [play, build]) + reports(executor, [build, play]):
        assert report.trouble is None


def test_a_block_that_fails_does_not_touch_the_others(executor: Executor, plan: Plan) -> None:
    executor.provide("no model", Artifact({}, {}))
    first, second, third = roots(plan)[:3]
    broken = replace(second, key="broken", artifacts={"agent": "no model"})
    job = PlayJob(((first, None), (broken, None), (third, None)))
    (report,) = reports(executor, [job])
    assert report.trouble is None
    assert [block.outcome is None for block in report.blocks] == [False, True, False]
    assert report.blocks[1].key == "broken"
    assert "KeyError" in report.blocks[1].error
    (again,) = reports(executor, [PlayJob(((first, None),))])
    assert again.blocks[0].outcome == report.blocks[0].outcome


def test_a_build_that_fails(executor: Executor, plan: Plan) -> None:
    good = plan.recipes[plan.by_seed("agent")[0]]
    broken = Recipe("agent", good.params | {"config": {"updates": "many"}}, good.inputs)
    failed, done = reports(executor, [BuildJob(broken), BuildJob(good)])
    assert failed.trouble == "failed"
    assert failed.artifact is None
    assert "updates" in failed.error
    assert done.trouble is None


def test_a_build_on_bad_data(executor: Executor, plan: Plan, finished: Place) -> None:
    good = plan.recipes[plan.by_seed("agent")[0]]
    real = finished.store.read("maze-demonstrations", good.inputs["demonstrations"])
    observations = real.arrays["observations"].copy()
    observations[17, 2] = np.nan
    executor.provide("bad", Artifact(real.arrays | {"observations": observations}, real.info))
    job = BuildJob(Recipe("agent", good.params, {"demonstrations": "bad"}))
    (report,) = reports(executor, [job])
    assert report.trouble == "bad data"
    assert report.error == "demonstrations/observations.npy: row 17 is not finite"


@pytest.mark.parametrize("kind", KINDS)
def test_closing_drops_what_is_in_flight(
    kind: ExecutorKind, plan: Plan, finished: Place, request: pytest.FixtureRequest
) -> None:
    """As when the driver ends with an error: that error is what must be seen."""
    executor = opened(kind, request)
    for key, recipe in plan.recipes.items():
        executor.provide(key, finished.store.read(recipe.kind, key))
    endless = replace(roots(plan)[0], episodes=(0, 10**6))
    for job in [*alone(endless, *roots(plan)), BuildJob(plan.recipes[plan.by_seed("agent")[0]])]:
        executor.submit(job)
    executor.close()

    following = opened(kind, request)
    for key in roots(plan)[0].artifacts.values():
        following.provide(key, finished.store.read("agent", key))
    (report,) = reports(following, alone(roots(plan)[0]))
    assert report.blocks[0].outcome is not None
    following.close()

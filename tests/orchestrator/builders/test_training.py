"""Models as they are built and loaded: MF-Stitch's policy, and initiation sets."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from orchestrator.builders.models import load_models
from orchestrator.builders.parts import as_artifact
from orchestrator.builders.registry import BUILDERS
from orchestrator.spec.structure import to_plain
from orchestrator.storage.store import Artifact
from stitching.data.maze import MazeDataConfig, skill_demonstrations
from stitching.data.mixtures import Mixture, skill_pairs
from stitching.data.transitions import Transitions
from stitching.envs.kitchen import KITCHEN
from stitching.envs.maze import MAZE
from stitching.envs.protocol import Benchmark
from stitching.envs.robosuite.can import CAN
from stitching.envs.robosuite.door import DOOR
from stitching.models.iql import IQLConfig
from stitching.streams import stream

DEMONSTRATIONS = as_artifact(skill_demonstrations(MAZE, MazeDataConfig(episodes=3), seed=0))
SKILLS = IQLConfig(updates=40, batch_size=32, learning_rate=1e-2, members=1, width=8, log_every=20)
STATES = torch.from_numpy(MAZE.observations[MAZE.free])


def built(kind: str, config: IQLConfig, inputs: dict[str, Artifact], **params: str) -> Artifact:
    recipe = {"benchmark": "maze", "root_seed": 0, "seed": 0, "config": to_plain(config), **params}
    return BUILDERS[kind].make(recipe, {"demonstrations": DEMONSTRATIONS, **inputs})


@pytest.mark.parametrize("multi_task", [True, False], ids=["one network", "one a pair"])
@pytest.mark.parametrize(("mixture", "condition"), [("halves", 4), ("next-skill", 2)])
def test_a_policy_brings_its_pairs_conditions(
    mixture: Mixture, condition: int, multi_task: bool
) -> None:
    config = replace(SKILLS, multi_task=multi_task)
    made = built("mf-policy", config, {}, mixture=mixture)
    assert made.arrays["conditions"].shape == (12, condition)
    assert set(made.info["curves"]) >= {"value_loss", "policy_loss"}
    assert [update for update, _ in made.info["curves"]["policy_loss"]] == [20, 40]
    assert not any(" of " in name for name in made.info["curves"])
    policy = load_models(MAZE, {"mf-policy": made}).trained["mf-policy"]
    for pair in range(12):
        assert policy.act(STATES, pair, noise=None).shape == (len(STATES), 4)


@pytest.mark.parametrize("multi_task", [True, False], ids=["one network", "one a pair"])
def test_fine_tuning_begins_as_the_next_skill(multi_task: bool) -> None:
    taught = built("agent", replace(SKILLS, multi_task=multi_task), {})
    untuned = replace(SKILLS, multi_task=multi_task, updates=0)
    made = built("mf-policy", untuned, {"agent": taught}, mixture="fine-tuned")
    models = load_models(MAZE, {"agent": taught, "mf-policy": made})
    for pair, (_, following) in enumerate(skill_pairs(4)):
        actions = models.trained["mf-policy"].act(STATES, pair, noise=None)
        assert np.array_equal(actions, models.agent.act(STATES, following, noise=None))


def a_robot_that_obeys() -> Transitions:
    """Kitchen's observations of an arm whose joints do as they are told; two skills are shown."""
    rng, steps = stream("obeys"), 30
    actions = rng.uniform(-0.5, 0.5, size=(4, steps, 9)).astype(np.float32)
    states = rng.normal(size=(4, 1, KITCHEN.observation_size)).repeat(steps + 1, axis=1)
    states[:, 1:, :9] += 0.1 * actions.cumsum(axis=1)
    for column in KITCHEN.factors.objects["kettle"].positions:
        states[:2, -3:, column] += 1.0
    for column in KITCHEN.factors.objects["microwave"].positions:
        states[2:, -3:, column] += 1.0
    states = states.astype(np.float32)
    return Transitions(
        observations=states[:, :-1].reshape(4 * steps, -1),
        actions=actions.reshape(4 * steps, -1),
        next_observations=states[:, 1:].reshape(4 * steps, -1),
        episode_ends=steps * np.arange(1, 5),
        episode_skills=np.array([6, 6, 5, 5]),
        episode_successes=np.ones(4, dtype=bool),
    )


def test_each_way_of_altering_the_data_reaches_the_agent() -> None:
    data = a_robot_that_obeys()

    def agent(
        swap: float = 0.0, corrections: float = 0.0, multi_task: bool = True
    ) -> dict[str, np.ndarray]:
        usual = replace(SKILLS, clip=True, multi_task=multi_task)
        config = replace(usual, swap=swap, corrections=corrections)
        recipe = {"benchmark": "kitchen", "root_seed": 0, "seed": 0, "config": to_plain(config)}
        recipe["factors"] = to_plain(KITCHEN.factors)
        return dict(BUILDERS["agent"].make(recipe, {"demonstrations": as_artifact(data)}).arrays)

    plain, swapped, corrected = agent(), agent(swap=0.8), agent(corrections=1.5)
    both = agent(swap=0.8, corrections=1.5)
    weights = [each["policy.w0"].tobytes() for each in (plain, swapped, corrected, both)]
    assert len(set(weights)) == 4
    low, wider = plain["observation_low"], corrected["observation_low"]
    assert (wider[:9] < low[:9] - 0.05).all()
    assert np.array_equal(wider[18:], low[18:])
    assert np.array_equal(swapped["observation_low"], low)
    with pytest.raises(NotImplementedError, match="do not learn from altered data"):
        agent(corrections=1.5, multi_task=False)


def test_initiation_sets_know_which_objects_their_skills_are_not_about() -> None:
    """Two skills of Kitchen are shown, each once, from another state; the last fails."""
    skills = np.array([0, 5, 1])
    states = stream("kitchen").normal(size=(3, 5, KITCHEN.observation_size)).astype(np.float32)
    data = Transitions(
        observations=states[:, :-1].reshape(12, -1),
        actions=np.zeros((12, KITCHEN.actions.size), dtype=np.float32),
        next_observations=states[:, 1:].reshape(12, -1),
        episode_ends=np.array([4, 8, 12]),
        episode_skills=skills,
        episode_successes=np.array([True, True, False]),
    )
    recipe = {"benchmark": "kitchen", "factors": to_plain(KITCHEN.factors)}
    made = BUILDERS["initiation-sets"].make(recipe, {"demonstrations": as_artifact(data)})
    sets = load_models(KITCHEN, {"initiation-sets": made}).trained["initiation-sets"]
    assert sets.columns == list(KITCHEN.factors.pose)
    for number, skill in enumerate(KITCHEN.skills):
        assert sets.others[number] == KITCHEN.factors.others_than(skill.name)
        shown = number in (0, 5)
        assert bool(len(sets.states[number])) == shown == np.isfinite(sets.radii[number])
    assert torch.equal(sets.states[5][0], torch.from_numpy(states[1, 0]))
    assert made.info["sizes"] == [len(each) for each in sets.states]


@pytest.mark.parametrize("benchmark", [KITCHEN, DOOR, CAN, MAZE], ids=lambda each: each.name)
def test_initiation_sets_know_how_the_robot_moves(benchmark: Benchmark) -> None:
    """Where actions are continuous: here each moves one number of what is seen."""
    rng, n, size = stream("moves"), 400, benchmark.actions.size
    states = rng.normal(size=(n, benchmark.observation_size))
    actions = rng.uniform(-1, 1, size=(n, size))
    discrete = benchmark.actions.discrete
    following, moved = states.copy(), list(benchmark.factors.pose)[:size]
    following[:, moved] += 0.3 * actions[:, : len(moved)]
    data = Transitions(
        states.astype(np.float32),
        (np.eye(size)[rng.integers(size, size=n)] if discrete else actions).astype(np.float32),
        following.astype(np.float32),
        np.arange(10, n + 1, 10),
        np.arange(n // 10) % len(benchmark.skills),
        np.ones(n // 10, dtype=bool),
    )
    recipe = {"benchmark": benchmark.name, "factors": to_plain(benchmark.factors)}
    made = BUILDERS["initiation-sets"].make(recipe, {"demonstrations": as_artifact(data)})
    sets = load_models(benchmark, {"initiation-sets": made}).trained["initiation-sets"]
    here = torch.from_numpy(data.observations[:3])
    plan = sets.towards(here, sets.nearest(here, 0), 2)
    assert (plan is None) == discrete
    if plan is not None:
        assert plan.shape == (3, 2, size)
        gap = torch.zeros(3, len(benchmark.factors.pose))
        gap[:, 0] = 0.3
        there = here[:, list(benchmark.factors.pose)] + gap
        towards = sets.steering.towards(here, there, 1)[:, 0]
        assert torch.allclose(towards[:, 0], torch.full((3,), 1 / 3), atol=0.05)
        assert towards[:, 1:].abs().max() < 0.05

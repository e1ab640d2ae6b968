"""MF-Stitch's policy as it is built and loaded: told of the right skills, begun where it should."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from orchestrator.builders import BUILDERS
from orchestrator.builders.models import load_models
from orchestrator.builders.parts import as_artifact
from orchestrator.store import Artifact
from orchestrator.structure import to_plain
from stitching.data.maze import MazeDataConfig, skill_demonstrations
from stitching.data.mixtures import Mixture, skill_pairs
from stitching.envs.maze import MAZE
from stitching.models.iql import IQLConfig

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
    policy = load_models(MAZE, {}, {"mf-policy": made})["mf-policy"]
    for pair in range(12):
        assert policy.act(STATES, pair, noise=None).shape == (len(STATES), 4)


@pytest.mark.parametrize("multi_task", [True, False], ids=["one network", "one a pair"])
def test_fine_tuning_begins_as_the_next_skill(multi_task: bool) -> None:
    taught = built("agent", replace(SKILLS, multi_task=multi_task), {})
    untuned = replace(SKILLS, multi_task=multi_task, updates=0)
    made = built("mf-policy", untuned, {"agent": taught}, mixture="fine-tuned")
    models = load_models(MAZE, {}, {"agent": taught, "mf-policy": made})
    for pair, (_, following) in enumerate(skill_pairs(4)):
        actions = models["mf-policy"].act(STATES, pair, noise=None)
        assert np.array_equal(actions, models["agent"].act(STATES, following, noise=None))

"""Training speed of IQL: five members stacked in one pass against one-member agents in turn.

Each one-member agent also learns a policy of its own, which the ensemble learns once: that is
part of what stacking saves. Data is random; the time of an update does not depend on its content.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from orchestrator.spec.spec import load_spec
from stitching.data.experience import Experience
from stitching.data.transitions import Transitions
from stitching.envs.maze import MAZE
from stitching.envs.protocol import ActionSpace
from stitching.models.iql import IQLConfig, train_iql
from tests.bench.result import Result, alternate

MEMBERS = 5
ROWS = 5_000
REPETITIONS = 3


def measure() -> Iterator[Result]:
    kitchen = IQLConfig(width=256, batch_size=256)
    yield _compare("Kitchen", 59, 7, ActionSpace(9, discrete=False), kitchen, updates=20)
    maze = load_spec("table1").agent
    yield _compare("maze", MAZE.observation_size, 2, MAZE.actions, maze, updates=100)


def _compare(
    shape: str,
    observation: int,
    condition: int,
    actions: ActionSpace,
    config: IQLConfig,
    updates: int,
) -> Result:
    experience = _random_experience(observation, condition, actions)
    ensemble = replace(config, members=MEMBERS, updates=updates)
    alone = replace(ensemble, members=1)

    def one_at_a_time() -> None:
        for member in range(MEMBERS):
            train_iql(experience, actions, alone, "bench", member)

    stacked, in_turn = alternate(
        REPETITIONS, lambda: train_iql(experience, actions, ensemble, "bench"), one_at_a_time
    )
    member_updates = MEMBERS * updates
    return Result(
        "iql",
        f"{shape} shape: {MEMBERS} members stacked over one at a time",
        {
            "member-updates/s stacked": member_updates / stacked,
            "one at a time": member_updates / in_turn,
        },
        ratio=in_turn / stacked,
    )


def _random_experience(observation: int, condition: int, actions: ActionSpace) -> Experience:
    rng = np.random.default_rng(0)
    data = Transitions(
        observations=rng.standard_normal((ROWS, observation), dtype=np.float32),
        actions=actions.uniform(rng, (ROWS,)),
        next_observations=rng.standard_normal((ROWS, observation), dtype=np.float32),
        episode_ends=np.array([ROWS]),
        episode_skills=np.array([0]),
        episode_successes=np.array([True]),
    )
    return Experience(
        data,
        rows=np.arange(ROWS),
        condition_ids=np.zeros(ROWS, dtype=np.int64),
        conditions=np.ones((1, condition), dtype=np.float32),
        rewards=np.zeros(ROWS, dtype=np.float32),
        terminals=np.zeros(ROWS, dtype=bool),
    )

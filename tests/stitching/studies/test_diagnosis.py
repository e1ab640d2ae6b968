"""What is known of models before a planner is judged by them."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from stitching.data.transitions import Transitions
from stitching.envs.maze import Maze
from stitching.models.agent import Agent
from stitching.models.dynamics import Dynamics
from stitching.rollout import RolloutConfig
from stitching.studies.diagnosis import competence, prediction_errors, prices, value_progress


class Known(Dynamics):
    """Two members that are off by chosen amounts, in a world where nothing moves."""

    def __init__(self, errors: torch.Tensor) -> None:
        self.errors = errors  # (2, n)

    def __call__(self, states: torch.Tensor, actions: torch.Tensor) -> torch.Tensor:
        return states + self.errors[:, : states.shape[1], None]

    def scaled(self, states: torch.Tensor) -> torch.Tensor:
        return 2 * states


def still(rows: int, lengths: list[int]) -> Transitions:
    observations = np.zeros((rows, 3), dtype=np.float32)
    return Transitions(
        observations=observations,
        actions=np.zeros((rows, 2), dtype=np.float32),
        next_observations=observations + 1,
        episode_ends=np.cumsum(lengths),
        episode_skills=np.zeros(len(lengths), dtype=np.int64),
        episode_successes=np.ones(len(lengths), dtype=bool),
    )


def test_errors_are_in_units_of_the_data_s_scale() -> None:
    errors = torch.tensor([[0.5], [1.0]]).expand(2, 8)  # the members' spread is constant
    study = prediction_errors(Known(errors), still(8, [5, 3]), {"all": slice(0, 3)}, horizon=2)
    assert study["1"]["states"] == study["2"]["states"] == 4 + 2
    assert study["1"]["groups"]["all"]["rmse"] == pytest.approx(2 * 0.25)
    assert study["1"]["groups"]["all"]["relative"] == pytest.approx(0.25)
    assert study["2"]["groups"]["all"]["rmse"] == pytest.approx(2 * 0.5)
    assert study["1"]["disagreement_rank_correlation"] == 0


def test_disagreement_that_tells_errors_apart_ranks_them() -> None:
    size = torch.linspace(0.1, 1, 7)
    doubtful = torch.stack([1 + size, 1 + 3 * size])  # spread and error grow together
    study = prediction_errors(Known(doubtful), still(8, [8]), {"all": slice(0, 3)}, horizon=2)
    assert study["1"]["disagreement_rank_correlation"] == pytest.approx(1)
    assert len(study["1"]["points"]) == 7


def test_values_rise_along_demonstrations(
    maze: Maze, demonstrations: Transitions, agent: Agent
) -> None:
    study = value_progress(agent, maze, demonstrations)
    assert set(study) == {skill.name for skill in maze.skills}
    for skill in study.values():
        assert skill["rank_correlation"] > 0.8
        assert skill["mean"][-1] > skill["mean"][0]
        assert len(skill["mean"]) == len(skill["spread"]) == len(skill["curves"][0])


def test_values_of_failures_are_left_out(
    maze: Maze, demonstrations: Transitions, agent: Agent
) -> None:
    none = np.zeros_like(demonstrations.episode_successes)
    assert value_progress(agent, maze, replace(demonstrations, episode_successes=none)) == {}


def test_prices_are_the_variances_of_equation_2(
    maze: Maze, demonstrations: Transitions, agent: Agent, dynamics: Dynamics
) -> None:
    study = prices(agent, dynamics, maze, demonstrations, horizon=2)
    assert set(study) == {skill.name for skill in maze.skills}
    (rows,) = demonstrations.episode_rows(0)[:1]
    own = study[maze.skills[0].name]
    one = Transitions(
        observations=demonstrations.observations[rows[:2]],
        actions=demonstrations.actions[rows[:2]],
        next_observations=demonstrations.next_observations[rows[:2]],
        episode_ends=np.array([2]),
        episode_skills=np.array([0]),
        episode_successes=np.array([True]),
    )
    alone = prices(agent, dynamics, maze, one, horizon=2)[maze.skills[0].name]
    assert alone["states"] == 1 < own["states"]
    sequence = torch.from_numpy(one.actions)[None]
    imagined = dynamics.imagine(torch.from_numpy(one.observations[:1]), sequence)
    values = agent.values(imagined.mean(dim=0), 0)
    assert alone["value_spread"] == pytest.approx(float(values.std(dim=0, correction=0)), rel=1e-4)
    spread = dynamics.scaled(imagined).std(dim=0, correction=0).mean()
    assert alone["dynamics_spread"] == pytest.approx(float(spread), rel=1e-4)


def test_policies_are_tried_where_their_demonstrations_begin(
    maze: Maze, demonstrations: Transitions, agent: Agent
) -> None:
    starts = np.tile(np.array(maze.spawn, dtype=float), (len(demonstrations.episode_ends), 1))
    study = competence(agent, maze, RolloutConfig(), 50, demonstrations, starts, 0, 0)
    counts = np.bincount(demonstrations.episode_skills)
    assert [study[skill.name]["trials"] for skill in maze.skills] == counts.tolist()
    assert sum(skill["successes"] for skill in study.values()) >= counts.sum() / 2
    never = competence(
        agent, maze, replace(RolloutConfig(), skill_limit=1), 50, demonstrations, starts, 0, 0
    )
    assert all(skill["successes"] == 0 for skill in never.values())

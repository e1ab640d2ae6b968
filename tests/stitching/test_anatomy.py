"""Stitches taken apart are those of an evaluation, and what is written down of them is right."""

from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
import pytest
import torch

from stitching.anatomy import Subject, Surroundings, anatomy
from stitching.data.transitions import Transitions
from stitching.envs.maze import Maze
from stitching.models.agent import Agent
from stitching.models.dynamics import Dynamics
from stitching.planning.objective import spread_over_members
from stitching.planning.random_shooting import RandomShooting
from stitching.rollout import Play, RolloutConfig, play_from_start
from stitching.stitchers import MBStitch, NoStitch, Proposal, Stitcher

EPISODES = 8
PAIRS = [("b", "a"), ("b", "d"), ("d", "b")]
LIMIT = 30


@dataclass(frozen=True)
class EveryOther(MBStitch):
    """Declines the second, fourth, … of those it is asked about."""

    def propose(self, *asked: Any) -> Proposal:
        proposal = super().propose(*asked)
        return replace(proposal, wanted=np.arange(len(proposal.actions)) % 2 == 0)


@pytest.fixture(scope="module", params=["mb-stitch", "mb-stitch[execute=1]", "every other"])
def subject(
    maze: Maze, agent: Agent, stitchers: dict[str, Stitcher], request: pytest.FixtureRequest
) -> Subject:
    declines = request.param == "every other"
    stitcher = stitchers["mb-stitch[execute=1]" if declines else request.param]
    assert isinstance(stitcher, MBStitch)
    if declines:
        stitcher = EveryOther(
            **{each.name: getattr(stitcher, each.name) for each in fields(stitcher)}
        )
    return Subject(maze, agent, stitcher, RolloutConfig(), LIMIT, root_seed=0, seed=0)


@pytest.fixture(scope="module")
def study(subject: Subject, demonstrations: Transitions) -> dict[str, Any]:
    return anatomy(subject, demonstrations, PAIRS, EPISODES)


@pytest.mark.parametrize("pair", PAIRS)
def test_both_ways_are_as_an_evaluation_plays_them(
    subject: Subject, study: dict[str, Any], pair: tuple[str, str]
) -> None:
    own = [s for s in study["stitches"] if (s["first"], s["second"]) == pair]
    ways: dict[str, tuple[str, Stitcher]] = {
        "without": ("no-stitch", NoStitch()),
        "with": ("mb-stitch", subject.stitcher),
    }
    for way, (method, stitcher) in ways.items():
        play = Play(0, subject.benchmark.name, 0, method, tuple(range(EPISODES)), pair)
        first, *second = play_from_start(
            subject.benchmark.block(), subject.agent, stitcher, subject.benchmark,
            subject.rollout, play, LIMIT,
        )  # fmt: skip
        assert [s["episode"] for s in own] == np.flatnonzero(first.success).tolist()
        assert own  # else nothing is tested
        assert [s[f"succeeds_{way}"] for s in own] == second[0].success.tolist()
        assert [s[f"steps_{way}"] for s in own] == second[0].steps.tolist()
        if way == "with":
            assert [len(s["value"]) - 1 for s in own] == second[0].stitch_steps.tolist()
            ends = [s["value"][-1] for s in own]
            np.testing.assert_allclose(ends, second[0].value_end, atol=1e-4)
            starts = [s["value"][0] for s in own]
            np.testing.assert_allclose(starts, second[0].value_start, atol=1e-4)


def test_some_stitch_is_taken_apart_step_by_step(subject: Subject, study: dict[str, Any]) -> None:
    assert any(stitch["plans"] for stitch in study["stitches"])
    for stitch in study["stitches"]:
        steps = len(stitch["value"]) - 1
        assert len(stitch["spread"]) == len(stitch["distance"]) == steps + 1
        plans = range(0, steps, subject.stitcher.execute)
        assert [plan["step"] for plan in stitch["plans"]] == list(plans)


def test_plans_are_written_down_as_eq_2_sees_them(
    subject: Subject, demonstrations: Transitions
) -> None:
    """With plans of one action the objective is made of the very terms that are written down."""
    planner = RandomShooting(population=30, horizon=1)
    stitcher = replace(subject.stitcher, planner=planner, alpha=2.0, beta=3.0, execute=1)
    short = anatomy(replace(subject, stitcher=stitcher), demonstrations, PAIRS[:1], EPISODES)
    plans = [plan for stitch in short["stitches"] for plan in stitch["plans"]]
    assert plans
    for plan in plans:
        expected = plan["value"] - 2.0 * plan["spread"] - 3.0 * plan["disagreement"]
        assert plan["objective"] == pytest.approx(expected, abs=2e-4)


def test_real_values_are_the_agent_s(subject: Subject, study: dict[str, Any]) -> None:
    (stitch, *_) = (s for s in study["stitches"] if (s["first"], s["second"]) == PAIRS[0])
    play = Play(0, subject.benchmark.name, 0, "", (stitch["episode"],), PAIRS[0][:1])
    block = subject.benchmark.block()
    first = play_from_start(
        block, subject.agent, NoStitch(), subject.benchmark, subject.rollout, play, LIMIT
    )
    assert first[0].success.all()
    values = subject.agent.values(torch.from_numpy(block.observe(np.arange(1))), 0)
    assert stitch["value"][0] == pytest.approx(float(values.mean(dim=0)), abs=1e-4)
    assert stitch["spread"][0] == pytest.approx(float(spread_over_members(values)), abs=1e-4)


def test_demonstrated_states_are_at_no_distance(
    demonstrations: Transitions, dynamics: Dynamics
) -> None:
    near = Surroundings.of(demonstrations, 2, dynamics)
    rows = np.concatenate(demonstrations.episode_rows(2))
    own = dynamics.scaled(torch.from_numpy(demonstrations.observations[rows]))
    assert near.distances(own).max() == 0
    away = own[:1] + 100.0
    assert float(near.distances(away)) == pytest.approx(100.0, rel=0.1)


class Unscaled(Dynamics):
    def __init__(self) -> None:
        """Has learned nothing."""

    def scaled(self, states: torch.Tensor) -> torch.Tensor:
        return states


def test_demonstrations_are_typically_as_far_apart_as_they_are() -> None:
    observations = np.repeat(np.array([[0.0], [0.5], [9.0]], dtype=np.float32), [3, 3, 1], axis=0)
    data = Transitions(
        observations=np.tile(observations, (1, 4)),
        actions=np.zeros((7, 2), dtype=np.float32),
        next_observations=np.zeros((7, 4), dtype=np.float32),
        episode_ends=np.array([3, 6, 7]),
        episode_skills=np.array([0, 0, 1]),
        episode_successes=np.ones(3, dtype=bool),
    )
    assert Surroundings.of(data, 0, Unscaled()).typical() == pytest.approx(0.5)
    assert Surroundings.of(data, 1, Unscaled()).typical() is None

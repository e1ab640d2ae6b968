"""Stitches taken apart are those of an evaluation, and what is written down of them is right."""

from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
import pytest
import torch

from stitching.data.transitions import Transitions
from stitching.envs.maze import Maze
from stitching.methods.mb_stitch import MBStitch
from stitching.methods.no_stitch import NoStitch
from stitching.methods.protocol import Proposal, Stitcher
from stitching.models.agent import Agent
from stitching.planning.objective import spread_over_members
from stitching.planning.random_shooting import RandomShooting
from stitching.rollout import Block, RolloutConfig, play_from_start
from stitching.studies.stitches import START, StudiedMethod, study_stitches
from tests.sections import with_sections

EPISODES = 8
PAIRS = [("b", "a"), ("b", "d"), ("d", "b")]
STARTS = [(START, "b"), (START, "d")]
LIMIT = 30


@dataclass(frozen=True)
class EveryOther(MBStitch):
    """Declines the second, fourth, … of those it is asked about."""

    def proposal(self, *asked: Any) -> Proposal:
        proposal = super().proposal(*asked)
        return replace(proposal, wanted=np.arange(len(proposal.actions)) % 2 == 0)


@pytest.fixture(scope="module", params=["mb-stitch", "mb-stitch[execute=1]", "every other"])
def studied(
    maze: Maze, agent: Agent, stitchers: dict[str, Stitcher], request: pytest.FixtureRequest
) -> StudiedMethod:
    declines = request.param == "every other"
    stitcher = stitchers["mb-stitch[execute=1]" if declines else request.param]
    assert isinstance(stitcher, MBStitch)
    if declines:
        stitcher = EveryOther(
            **{each.name: getattr(stitcher, each.name) for each in fields(stitcher)}
        )
    rollout = RolloutConfig(first_stitch=True)
    return StudiedMethod(maze, agent, stitcher, rollout, LIMIT, root_seed=0, seed=0)


@pytest.fixture(scope="module")
def study(studied: StudiedMethod, demonstrations: Transitions) -> dict[str, Any]:
    return study_stitches(studied, demonstrations, PAIRS, EPISODES)


@pytest.mark.parametrize("pair", STARTS + PAIRS)
def test_both_ways_are_as_an_evaluation_plays_them(
    studied: StudiedMethod, study: dict[str, Any], pair: tuple[str, str]
) -> None:
    """A pair's own first skill is No-Stitch's, whoever goes on from there."""
    own = [s for s in study["stitches"] if (s["first"], s["second"]) == pair]
    prefix = tuple(skill for skill in pair if skill != START)
    first_stitch = pair in STARTS
    rollout = replace(studied.rollout, first_stitch=first_stitch)
    ways: dict[str, tuple[str, Stitcher]] = {
        "without": ("no-stitch", NoStitch()),
        "with": ("mb-stitch", studied.stitcher),
    }
    for way, (method, stitcher) in ways.items():
        block = Block(0, studied.benchmark.name, 0, method, tuple(range(EPISODES)), prefix)
        *before, last = play_from_start(
            studied.benchmark.vector_env(), studied.agent, stitcher, studied.benchmark,
            rollout, block, LIMIT,
        )  # fmt: skip
        arrived = np.flatnonzero(before[0].success) if before else np.arange(EPISODES)
        assert [s["episode"] for s in own] == arrived.tolist()
        assert own  # else nothing is tested
        assert [s[f"succeeds_{way}"] for s in own] == last.success.tolist()
        assert [s[f"steps_{way}"] for s in own] == last.steps.tolist()
        if way == "with":
            assert [len(s["value"]) - 1 for s in own] == last.stitch_steps.tolist()
            ends = [s["value"][-1] for s in own]
            np.testing.assert_allclose(ends, last.value_end, atol=1e-4)
            starts = [s["value"][0] for s in own]
            np.testing.assert_allclose(starts, last.value_start, atol=1e-4)


def test_first_skills_are_taken_apart_only_where_they_are_stitched_to(
    studied: StudiedMethod, study: dict[str, Any], demonstrations: Transitions
) -> None:
    between = replace(studied, rollout=RolloutConfig())
    assert any(s["plans"] for s in study["stitches"] if s["first"] == START)
    without = study_stitches(between, demonstrations, PAIRS, EPISODES)
    pairs = [(pair["first"], pair["second"]) for pair in study["pairs"]]
    assert pairs == STARTS + PAIRS
    assert without["pairs"] == study["pairs"][len(STARTS) :]
    assert without["stitches"] == [s for s in study["stitches"] if s["first"] != START]


def test_some_stitch_is_taken_apart_step_by_step(
    studied: StudiedMethod, study: dict[str, Any]
) -> None:
    assert any(stitch["plans"] for stitch in study["stitches"])
    for stitch in study["stitches"]:
        steps = len(stitch["value"]) - 1
        assert len(stitch["spread"]) == len(stitch["distance"]) == steps + 1
        plans = range(0, steps, studied.stitcher.settings.execute)
        assert [plan["step"] for plan in stitch["plans"]] == list(plans)


def test_plans_are_written_down_as_eq_2_sees_them(
    studied: StudiedMethod, demonstrations: Transitions
) -> None:
    """With plans of one action the objective is made of the very terms that are written down."""
    planner = RandomShooting(population=30, horizon=1)
    settings = replace(studied.stitcher.settings, alpha=2.0, beta=3.0, execute=1)
    stitcher = replace(studied.stitcher, settings=with_sections(settings, planner))
    short = study_stitches(replace(studied, stitcher=stitcher), demonstrations, PAIRS[:1], EPISODES)
    plans = [plan for stitch in short["stitches"] for plan in stitch["plans"]]
    assert plans
    for plan in plans:
        expected = plan["value"] - 2.0 * plan["spread"] - 3.0 * plan["disagreement"]
        assert plan["objective"] == pytest.approx(expected, abs=2e-4)


def test_real_values_are_the_agent_s(studied: StudiedMethod, study: dict[str, Any]) -> None:
    (stitch, *_) = (s for s in study["stitches"] if (s["first"], s["second"]) == PAIRS[0])
    block = Block(0, studied.benchmark.name, 0, "", (stitch["episode"],), PAIRS[0][:1])
    env = studied.benchmark.vector_env()
    first = play_from_start(
        env, studied.agent, NoStitch(), studied.benchmark, studied.rollout, block, LIMIT
    )
    assert first[0].success.all()
    values = studied.agent.values(torch.from_numpy(env.observe(np.arange(1))), 0)
    assert stitch["value"][0] == pytest.approx(float(values.mean(dim=0)), abs=1e-4)
    assert stitch["spread"][0] == pytest.approx(float(spread_over_members(values)), abs=1e-4)

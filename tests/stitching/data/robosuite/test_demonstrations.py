"""Scripted robosuite hands: experts succeed, beginners often do not, and numbers decide it all."""

from copy import deepcopy
from dataclasses import astuple, replace
from functools import cache

import numpy as np
import pytest

from stitching.data.robosuite.demonstrations import (
    Demonstration,
    RobosuiteDataConfig,
    collect,
    demonstrate,
    held_out,
    starts,
)
from stitching.data.robosuite.programs import PROGRAMS, ScriptedDemonstrator, object_frame, style
from stitching.data.transitions import DataError, check
from stitching.envs.protocol import skill_index
from stitching.envs.robosuite.can import CAN, Can
from stitching.envs.robosuite.door import DOOR, HANDLE_TURN, HINGE, OPEN, Door
from stitching.envs.robosuite.vector_env import GRIP_POSITION
from stitching.streams import stream

EPISODES = 5
BEGINNER, EXPERT = 0.0, 1.0
ROW = np.arange(1)
BENCHMARK = {skill.name: benchmark for benchmark in (DOOR, CAN) for skill in benchmark.skills}


@cache
def shown(skill: str, quality: float) -> list[Demonstration]:
    config = RobosuiteDataConfig(episodes=EPISODES, quality=quality)
    return demonstrate(BENCHMARK[skill], config, skill, 0)


def test_every_skill_has_a_program() -> None:
    assert set(PROGRAMS) == set(BENCHMARK)


def test_a_better_hand_is_steadier_in_every_way() -> None:
    best, good, bad = (astuple(style(quality)) for quality in (1.0, 0.5, 0.0))
    assert all(a < b < c for a, b, c in zip(best, good, bad, strict=True))


@pytest.mark.parametrize("skill", PROGRAMS)
def test_experts_succeed_within_half_a_task(skill: str) -> None:
    demonstrations = shown(skill, EXPERT)
    limit = 25 if BENCHMARK[skill] is DOOR else 50  # half of the paper's, for two skills
    good = [one.success and len(one.actions) <= limit for one in demonstrations]
    assert np.mean(good) >= 0.8


def test_beginners_often_fail() -> None:
    """Over all three skills: each alone is a handful of episodes."""
    rates = {
        quality: np.mean([one.success for skill in PROGRAMS for one in shown(skill, quality)])
        for quality in (BEGINNER, EXPERT)
    }
    assert 0.1 < rates[BEGINNER] < 0.7 < rates[EXPERT]


def test_an_episode_depends_on_its_own_number_alone() -> None:
    config = RobosuiteDataConfig(episodes=EPISODES, quality=BEGINNER)
    (alone,) = demonstrate(DOOR, config, "close door", 0, [3])
    together = shown("close door", BEGINNER)[3]
    assert alone.observations.tobytes() == together.observations.tobytes()
    assert alone.actions.tobytes() == together.actions.tobytes()
    (other,) = demonstrate(DOOR, config, "close door", 1, [3])
    assert other.observations[0].tobytes() != alone.observations[0].tobytes()


def test_closing_begins_at_an_open_door_and_opening_at_a_closed_one() -> None:
    hinges = {
        skill: [one.observations[0, HINGE] for one in shown(skill, EXPERT)]
        for skill in ("open door", "close door")
    }
    assert max(hinges["open door"]) == 0
    assert min(hinges["close door"]) >= OPEN


def test_opening_turns_the_handle_down_and_closing_lifts_it() -> None:
    """So closing's data do not know the handle as opening leaves it."""
    opening, closing = (
        np.concatenate([one.observations[:, HANDLE_TURN] for one in shown(skill, EXPERT)])
        for skill in ("open door", "close door")
    )
    assert opening.min() > -0.3
    assert opening.max() > 1.2
    assert closing.max() < 0.3
    assert closing.min() < -1.2


def test_demonstrations_end_with_success() -> None:
    for skill in ("open door", "close door"):
        for one in shown(skill, EXPERT):
            hinges = one.observations[:, HINGE]
            there = hinges > 0.3 if skill == "open door" else hinges < 0.05
            assert there[-1] == one.success
            assert not there[:-1].any()


def test_the_handles_frame_follows_the_door_and_not_the_handle() -> None:
    at_rest = DOOR.vector_env()
    at_rest.reset([stream("frame")])
    snapshot = at_rest.snapshot(ROW)
    frames = []
    for hinge, handle in ((0, 0), (0, 1.3), (0.35, 0), (0.35, -1.0)):
        snapshot[0, 9:11] = hinge, handle
        at_rest.restore(snapshot, [stream("unused")])
        seen = at_rest.observe(ROW)[0]
        assert seen[HANDLE_TURN] == np.float32(handle)
        frames.append(np.r_[tuple(part.ravel() for part in object_frame("open door", seen))])
    np.testing.assert_allclose(frames[0], frames[1], atol=1e-3)
    np.testing.assert_allclose(frames[2], frames[3], atol=1e-3)
    assert np.abs(frames[0] - frames[2]).max() > 0.1


@pytest.mark.parametrize("skill", PROGRAMS)
def test_a_hand_that_has_lost_its_hold_begins_again(skill: str) -> None:
    """What it shows follows from what it sees, else nobody could learn it."""
    benchmark = BENCHMARK[skill]
    env = starts(benchmark, skill_index(benchmark, skill)).vector_env()
    env.reset([stream("hand")])
    hand = ScriptedDemonstrator(skill, benchmark.workspace, style(EXPERT), stream("draws"))
    closed = 0
    while closed < 4:  # two actions to take hold, and two more with it
        action = hand.act(env.observe(ROW)[0])
        closed += action[4] > 0
        env.step(ROW, action[None])
    seen = env.observe(ROW)[0]
    holding = deepcopy(hand).act(seen)
    seen[GRIP_POSITION] += [0.06, 0.06, 0.06]
    *_, fingers = hand.act(seen)
    assert holding[4] == 1
    assert fingers == -1


@pytest.mark.parametrize("benchmark", [DOOR, CAN], ids=lambda benchmark: benchmark.name)
def test_a_collection_can_be_trained_on(benchmark: Door | Can) -> None:
    config = RobosuiteDataConfig(episodes=3, quality=0.65, skill_steps=18)
    data = collect(benchmark, config, 0)
    check(data, benchmark, "here")
    assert len(data.episode_ends) == 3 * len(benchmark.skills)
    good = collect(benchmark, replace(config, keep_failures=False), 0)
    assert good.episode_successes.all()
    assert len(good.episode_ends) == data.episode_successes.sum()


def test_held_out_starts_count_whether_the_hand_succeeds_or_not() -> None:
    config = RobosuiteDataConfig(episodes=EPISODES, held_out=3, quality=0.3, skill_steps=18)
    data, begun = held_out(DOOR, config, 0)
    assert len(begun) == len(data.episode_ends) == 3 * len(DOOR.skills)
    assert 0 < data.episode_successes.sum() < len(begun)


def test_nothing_achieved_is_no_dataset() -> None:
    with pytest.raises(DataError, match="no demonstration"):
        collect(CAN, RobosuiteDataConfig(episodes=1, skill_steps=2), 0)

"""Door and can equal robosuite's own: starts to the bit, actions within 1e-6, through contacts.

Each action is played from the same state by both, the tasks done on the way. Where bodies slide or
bounce, robosuite itself amplifies by 1e5 and more what its joints are moved by, here 1e-13 rad;
there no more is promised.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import pytest

from stitching.envs.robosuite.can import CAN, Can
from stitching.envs.robosuite.door import DOOR, Door
from stitching.envs.robosuite.vector_env import RobosuiteVectorEnv
from stitching.streams import stream
from tests.stitching.envs.robosuite_original import Original, path_actions

EPISODES = 2
FIRST = np.arange(1)
TOLERANCE = 1e-6  # rad, m
CHAOS = (
    1e-8  # of robosuite's own answer to a nudge of 1e-13: so much amplified, nothing is promised
)
NUDGES = 1e-13 * np.array([[1.0] * 7, [1, -1] * 3 + [1]])


@dataclass(frozen=True)
class Step:
    """One action from one state."""

    gap: float  # between our positions and theirs
    own: float  # between theirs and theirs after a nudge
    observation: np.ndarray  # (2, 25) ours, theirs
    success: tuple[bool, bool]
    contacts: int


@pytest.fixture(scope="module", params=[DOOR, CAN], ids=lambda benchmark: benchmark.name)
def benchmark(request: pytest.FixtureRequest) -> Door | Can:
    return request.param


@pytest.fixture(scope="module")
def theirs(benchmark: Door | Can) -> Iterator[Original]:
    original = Original(benchmark)
    yield original
    original.env.close()


def begun(benchmark: Door | Can, theirs: Original, episode: int) -> RobosuiteVectorEnv:
    theirs.reset(stream("parity", episode))
    env = benchmark.vector_env()
    env.reset([stream("parity", episode)])
    return env


def played(benchmark: Door | Can, theirs: Original, episode: int) -> list[Step]:
    env = begun(benchmark, theirs, episode)
    actions = path_actions(benchmark, env.observe(FIRST)[0])
    # Its controller's first torques are from before the fingers stood where they start.
    theirs.step(actions[0])
    env.step(FIRST, actions[:1])
    steps = []
    for action in actions[1:]:
        before, command = theirs.state(), theirs.command()
        snapshot = env.snapshot(FIRST)
        snapshot[0, : len(before)] = before
        env.restore(snapshot, [stream("unused")])
        env.step(FIRST, action[None])
        ends = []
        for nudge in [0 * NUDGES[0], *NUDGES][::-1]:  # the last is the one to go on from
            theirs.go_to(before + np.r_[nudge, np.zeros(len(before) - 7)], command)
            theirs.step(action)
            ends.append(theirs.state()[: theirs.positions])
        after = theirs.state(), theirs.command(), theirs.data.ncon
        gap = np.abs(env.positions(FIRST)[0] - ends[-1]).max()
        own = max(np.abs(end - ends[-1]).max() for end in ends[:-1])
        success = bool(env.achieved(FIRST, 0)[0]), theirs.success()
        observations = np.stack((env.observe(FIRST)[0], theirs.observation()))
        theirs.go_to(*after[:2])
        steps.append(Step(gap, own, observations, success, after[2]))
    return steps


@pytest.fixture(scope="module")
def steps(benchmark: Door | Can, theirs: Original) -> list[Step]:
    return [step for episode in range(EPISODES) for step in played(benchmark, theirs, episode)]


def test_starts_are_theirs_to_the_bit(benchmark: Door | Can, theirs: Original) -> None:
    for episode in range(5):
        env = begun(benchmark, theirs, episode)
        assert env.positions(FIRST)[0].tobytes() == theirs.state()[: theirs.positions].tobytes()
        snapshot = env.snapshot(FIRST)[0]
        np.testing.assert_array_equal(snapshot[theirs.size + 1 :][:7], theirs.posture())
        np.testing.assert_allclose(env.observe(FIRST)[0], theirs.observation(), atol=1e-6)


def test_a_first_action_is_theirs(benchmark: Door | Can, theirs: Original) -> None:
    """Nearly: see `played`."""
    env = begun(benchmark, theirs, 0)
    action = path_actions(benchmark, env.observe(FIRST)[0])[0]
    theirs.step(action)
    env.step(FIRST, action[None])
    gap = env.positions(FIRST)[0] - theirs.state()[: theirs.positions]
    assert np.abs(gap).max() < TOLERANCE


def test_actions_are_theirs_through_contacts(steps: list[Step]) -> None:
    for index, step in enumerate(steps):
        assert step.gap < TOLERANCE or step.own > CHAOS, f"action {index}"
    assert np.mean([step.gap < TOLERANCE for step in steps]) > 0.8
    assert np.median([step.gap for step in steps]) < 1e-10


def test_what_is_seen_is_theirs(steps: list[Step]) -> None:
    for step in steps:
        if step.gap < TOLERANCE:
            # Its relative quaternions are of single precision.
            ours, original = step.observation
            np.testing.assert_allclose(ours, original, atol=1e-5)


def test_success_is_theirs_and_is_reached(steps: list[Step]) -> None:
    assert all(ours == other for ours, other in [step.success for step in steps])
    assert not steps[0].success[0]
    assert steps[-1].success[0]


def test_the_way_is_worth_comparing(benchmark: Door | Can, steps: list[Step]) -> None:
    assert np.mean([step.contacts >= 4 for step in steps]) > 0.4
    moved = np.ptp([step.observation[0, 11:] for step in steps], axis=0)
    assert moved.max() > (1.0 if benchmark is DOOR else 0.4)

"""What counts where no policy is told what is asked for: first achievements, in that order."""

from collections.abc import Iterable, Sequence

import numpy as np
import pytest

from stitching.envs.first_times import FirstTimes
from stitching.streams import stream

SKILLS = 3
ONE = np.arange(1)
NO_STREAM = [stream("unused")]


class Goals:
    """One episode in which the action says which goals hold; its snapshot says it, too."""

    def __init__(self) -> None:
        self.holding = np.zeros((1, SKILLS))

    def reset(self, streams: Sequence[np.random.Generator]) -> None:
        self.holding = np.zeros((1, SKILLS))

    def restore(self, snapshots: np.ndarray, streams: Sequence[np.random.Generator]) -> None:
        self.holding = snapshots

    def snapshot(self, rows: np.ndarray) -> np.ndarray:
        return self.holding[rows]

    def observe(self, rows: np.ndarray) -> np.ndarray:
        return self.holding[rows].astype(np.float32)

    def step(self, rows: np.ndarray, actions: np.ndarray) -> None:
        self.holding[rows] = actions

    def achieved(self, rows: np.ndarray, skill: int) -> np.ndarray:
        return self.holding[rows, skill] > 0


def accomplished(task: Iterable[int], scene: Iterable[Iterable[int]]) -> int:
    """Skills of a task that count, each from the snapshot that the one before left behind.

    scene: the goals that hold after each step.
    """
    env = FirstTimes(Goals(), SKILLS)
    env.reset(NO_STREAM)
    steps = iter(scene)
    for count, skill in enumerate(task):
        while not env.achieved(ONE, skill).any():
            goals = next(steps, None)
            if goals is None:
                return count
            env.step(ONE, np.isin(np.arange(SKILLS), list(goals))[None].astype(float))
        env.restore(env.snapshot(ONE), NO_STREAM)
    return count + 1


@pytest.mark.parametrize(
    ("task", "scene", "counted"),
    [
        ((0, 1), [{0}, {0, 1}], 2),
        ((0, 2), [{0}, {0, 1}, {0, 1, 2}], 2),  # others may come in between
        ((2,), [{0}, {0, 1}, {0, 1, 2}], 1),  # and before
        ((1, 0), [{0}, {0, 1}], 1),  # what came before it was asked for does not count,
        ((1, 0), [{0}, set(), {1}, {0, 1}], 1),  # nor if it came undone and comes again
        ((0, 1), [{0}, set(), {1}], 2),  # what came undone has been accomplished
        ((0, 1), [{0, 1}], 1),  # both at once are in no order
        ((0, 1), [{0}, set()], 1),
    ],
)
def test_what_counts(task: tuple[int, ...], scene: list[set[int]], counted: int) -> None:
    assert accomplished(task, scene) == counted


def test_a_goal_that_holds_at_the_start_is_never_achieved() -> None:
    class Reached(Goals):
        def reset(self, streams: Sequence[np.random.Generator]) -> None:
            self.holding = np.array([[1.0, 0.0, 0.0]])

    env = FirstTimes(Reached(), SKILLS)
    env.reset(NO_STREAM)
    env.step(ONE, np.array([[1.0, 1.0, 0.0]]))
    assert [bool(env.achieved(ONE, skill)[0]) for skill in range(SKILLS)] == [False, True, False]


def test_snapshots_end_with_what_has_held() -> None:
    env = FirstTimes(Goals(), SKILLS)
    env.reset(NO_STREAM)
    for goals in ([1.0, 0.0, 0.0], [0.0, 0.0, 1.0]):
        env.step(ONE, np.array([goals]))
    np.testing.assert_array_equal(env.snapshot(ONE), [[0, 0, 1, 1, 0, 1]])

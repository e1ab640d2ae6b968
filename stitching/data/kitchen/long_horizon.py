"""Demonstrations of one long task that nobody cuts into skills (paper 4.3.1, Single-Policy).

The same demonstrators as in the skills' data do four skills in a row. What is kept is the task as
a whole: demonstrations that miss a skill, or do one out of turn, are left out, where the skills'
data keep the skills before.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from stitching.data.kitchen.demonstrations import Demonstrator, KitchenDataConfig, demonstrate
from stitching.data.kitchen.segments import Episode, Order, Segment, as_transitions, cut
from stitching.data.transitions import NO_SKILL, DataError, Transitions
from stitching.envs.kitchen import KITCHEN
from stitching.streams import stream

TOGETHER = 40  # demonstrations played at once: a matter of memory, no episode depends on it


def long_horizon_data(
    config: KitchenDataConfig, order: Order, seed: int
) -> tuple[Transitions, np.ndarray]:
    """Whole demonstrations of an order, and rewards (N,) float32: 1 at each accomplishment.

    Raises DataError where there is none.
    """
    demonstrated = (cut(episode, order) for episode in _played(config, order, seed))
    tasks = [
        skills for skills in demonstrated if [s.success for s in skills] == [True] * len(order)
    ]
    if not tasks:
        raise DataError(f"no demonstration of {'>'.join(order)} accomplishes all of it in order")
    whole = [Segment(s[0].episode, 0, s[-1].end, NO_SKILL, success=True) for s in tasks]
    data = as_transitions(whole)
    rewards = np.zeros(len(data), dtype=np.float32)
    for start, skills in zip(data.episode_starts, tasks, strict=True):
        rewards[[start + skill.end - 1 for skill in skills]] = 1
    return data, rewards


def _played(config: KitchenDataConfig, order: Order, seed: int) -> Iterator[Episode]:
    """An episode depends on the configuration, the seed, the order and its number alone.

    The arm is never taken elsewhere between two skills: that would be a cut.
    """
    config = replace(config, elsewhere=0.0)
    env = KITCHEN.vector_env()
    for first in range(0, config.episodes, TOGETHER):
        numbers = range(first, min(first + TOGETHER, config.episodes))
        labels = [("long horizon", "kitchen", seed, "-".join(order), e) for e in numbers]
        env.reset([stream("environment", *label) for label in labels])
        demonstrators = [Demonstrator(order, config, stream("hand", *label)) for label in labels]
        yield from demonstrate(env, demonstrators)

"""Robosuite actions a second: a block of episodes against robosuite's plain `env.step`.

    python -m tests.bench robosuite

Both do the same motions, the whole task from its start, in as many control steps; they take turns,
an episode of theirs and a block of ours. Ours is all that a rollout asks of it: observe, step,
achieved. Seconds are of the CPU and per episode. Robosuite's is its own step and nothing else.
"""

from __future__ import annotations

from collections.abc import Iterator
from statistics import median
from time import process_time

import numpy as np

from stitching.envs.robosuite.can import CAN, Can
from stitching.envs.robosuite.door import DOOR, Door
from stitching.streams import stream
from tests.bench.result import Result
from tests.stitching.envs.robosuite_original import Original, path_actions

ROUNDS = 5


def ours(benchmark: Door | Can, episodes: int) -> tuple[float, np.ndarray]:
    """Seconds an episode, and the actions (steps, 5) of the first."""
    env, rows = benchmark.vector_env(), np.arange(episodes)
    env.reset([stream("bench", int(row)) for row in rows])
    actions = np.stack([path_actions(benchmark, seen) for seen in env.observe(rows)], axis=1)
    began = process_time()
    for action in actions:
        env.observe(rows)
        env.step(rows, action)
        env.achieved(rows, 0)
    return (process_time() - began) / episodes, actions[:, 0]


def theirs(original: Original, actions: np.ndarray) -> tuple[float, int]:
    """Seconds of `env.step` in one episode, and how often it was called."""
    original.reset(stream("bench", 0))
    step, spent = original.env.step, [0.0]

    def timed(action: np.ndarray) -> object:
        began = process_time()
        answer = step(action)
        spent.append(process_time() - began)
        return answer

    original.env.step = timed
    for action in actions:
        original.step(action)
    original.env.step = step
    return sum(spent), len(spent) - 1


def measure(episodes: int = 10) -> Iterator[Result]:
    for benchmark in (DOOR, CAN):
        original = Original(benchmark)
        _, actions = ours(benchmark, 1)
        _, control_steps = theirs(original, actions)  # compiles its functions
        pairs = []
        for _ in range(ROUNDS):
            pairs.append((ours(benchmark, episodes)[0], theirs(original, actions)[0]))
        env, plain = (median(seconds) for seconds in zip(*pairs, strict=True))
        numbers = {
            "our actions/s": len(actions) / env,
            "their actions/s": len(actions) / plain,
            "control steps an action": control_steps / len(actions),
        }
        ratio = median(one / other for other, one in pairs)
        what = f"{benchmark.name} actions a second, {episodes} episodes, to env.step's"
        yield Result("robosuite", what, numbers, ratio, at_least=2.5)

"""Kitchen steps per second: a block of episodes against bare physics, and against the original.

    python -m tests.bench.bench_kitchen [episodes] [rounds]

Bare physics is `mj_step(model, data, nstep=40)` alone, from the same states under the same controls
as the block's episodes, so both do the same work; they take turns, a few steps each. The block's
time is all that a rollout asks of it: observe, step, achieved. Times are of the CPU, one thread, so
that neighbours on a shared machine disturb little; the ratio is the median over turns. Read the
ratios: steps per second depend on the machine. The original plays an episode of its own, so its
ratio is a rough one. The last line compares two processes at once with one, by the clock on the
wall: read it only from a machine that has two cores to spare.
"""

import sys
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from multiprocessing import get_context
from time import perf_counter, thread_time

import mujoco
import numpy as np
from gymnasium_robotics.envs.franka_kitchen.kitchen_env import KitchenEnv

from stitching.envs.kitchen import KITCHEN, PHYSICS, PHYSICS_SIZE, SUBSTEPS, kitchen_model
from stitching.streams import stream

TURN = 5  # steps


class Watch:
    """CPU seconds of each of its laps."""

    def __init__(self) -> None:
        self.laps: list[float] = []

    @property
    def seconds(self) -> float:
        return sum(self.laps)

    @contextmanager
    def lap(self) -> Iterator[None]:
        began = thread_time()
        yield
        self.laps.append(thread_time() - began)


def smooth_actions(steps: int, episodes: int) -> np.ndarray:
    """(steps, episodes, 9) float32: a walk that stays in reach of the furniture."""
    rng = stream("bench")
    actions = np.zeros((steps, episodes, 9), dtype=np.float32)
    for step in range(1, steps):
        nudge = 0.3 * rng.standard_normal((episodes, 9))
        actions[step] = np.clip(0.9 * actions[step - 1] + nudge, -1, 1)
    return actions


def against_bare_physics(episodes: int, rounds: int) -> None:
    model, rows = kitchen_model(), np.arange(episodes)
    actions = smooth_actions(rounds * TURN, episodes).reshape(rounds, TURN, episodes, 9)
    bare = [mujoco.MjData(model) for _ in rows]
    watched, rehearsal = KITCHEN.vector_env(), KITCHEN.vector_env()
    watched.reset([stream("bench", int(row)) for row in rows])
    block_watch, bare_watch = Watch(), Watch()
    for turn in range(rounds):
        before = watched.snapshot(rows)
        # The controls that the block is about to send, found by playing ahead.
        rehearsal.restore(before, [stream("bench", turn, int(row)) for row in rows])
        watched.restore(before, [stream("bench", turn, int(row)) for row in rows])
        controls = []
        for step in range(TURN):
            rehearsal.step(rows, actions[turn, step])
            controls.append([data.ctrl.copy() for data in rehearsal._pool])
        for data, snapshot in zip(bare, before, strict=True):
            mujoco.mj_setState(model, data, snapshot[:PHYSICS_SIZE], PHYSICS)

        def play_block(turn: int = turn) -> None:
            with block_watch.lap():
                for step in range(TURN):
                    watched.observe(rows)
                    watched.step(rows, actions[turn, step])
                    watched.achieved(rows, step)

        def play_bare(controls: list[list[np.ndarray]] = controls) -> None:
            with bare_watch.lap():
                for step in range(TURN):
                    for data, control in zip(bare, controls[step], strict=True):
                        data.ctrl[:] = control
                        mujoco.mj_step(model, data, nstep=SUBSTEPS)

        for play in (play_block, play_bare) if turn % 2 else (play_bare, play_block):
            play()
        for data, positions in zip(bare, watched.positions(rows), strict=True):
            np.testing.assert_array_equal(data.qpos, positions)  # the same work, indeed
    steps = rounds * TURN * episodes
    for name, watch in (("bare", bare_watch), ("block", block_watch)):
        ratio = np.median(np.divide(bare_watch.laps, watch.laps))
        print(f"{name:>10}{steps / watch.seconds:>10.1f}{ratio:>8.3f}")
    original(bare_watch.seconds / steps)


def original(bare_step: float, steps: int = 200) -> None:
    """The same for gymnasium-robotics' own environment; bare_step: seconds of one bare step."""
    env, actions, watch = KitchenEnv(), smooth_actions(steps, 1)[:, 0], Watch()
    env.reset(seed=0)
    with watch.lap():
        for action in actions:
            env.step(action)
    rate = steps / watch.seconds
    print(f"{'original':>10}{rate:>10.1f}{rate * bare_step:>8.3f}")


def wall_rate(episodes: int, steps: int = 40) -> float:
    """Episode steps per second of one process, by the clock on the wall."""
    env, rows = KITCHEN.vector_env(), np.arange(episodes)
    env.reset([stream("bench", int(row)) for row in rows])
    env.step(rows, np.zeros((episodes, 9), dtype=np.float32))
    began = perf_counter()
    for actions in smooth_actions(steps, episodes):
        env.observe(rows)
        env.step(rows, actions)
        env.achieved(rows, 0)
    return steps * episodes / (perf_counter() - began)


def two_processes(episodes: int) -> None:
    with ProcessPoolExecutor(2, mp_context=get_context("spawn")) as pool:
        list(pool.map(wall_rate, [1, 1]))  # both started, model loaded
        alone = pool.submit(wall_rate, episodes).result()
        together = sum(pool.map(wall_rate, [episodes] * 2))
    print(f"{'two cores':>10}{together:>10.1f}{together / alone:>8.3f}  times one process")


def main() -> None:
    given = [int(argument) for argument in sys.argv[1:]]
    episodes, rounds = (*given, *(10, 40)[len(given) :])
    print(f"{episodes} episodes, {rounds * TURN} steps each")
    print(f"{'':>10}{'steps/s':>10}{'ratio':>8}")
    against_bare_physics(episodes, rounds)
    two_processes(episodes)


if __name__ == "__main__":
    main()

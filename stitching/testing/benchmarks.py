"""What every benchmark must do.

Bytes are compared, never closeness: the rollout tree, and every resumed run, rest on it.
"""

from __future__ import annotations

import copy
from collections.abc import Sequence

import numpy as np

from stitching.envs.protocol import Benchmark, VectorEnv, conditions
from stitching.streams import stream

EPISODES, STEPS = 3, 6
ROWS = np.arange(EPISODES)


def streams(
    episodes: Sequence[int] | np.ndarray = range(EPISODES), use: str = ""
) -> list[np.random.Generator]:
    """One stream an episode, the same with every call."""
    return [stream("conformance", use, int(episode)) for episode in episodes]


def started(
    benchmark: Benchmark, episodes: Sequence[int] | np.ndarray = range(EPISODES)
) -> VectorEnv:
    """An environment with these episodes at their start."""
    env = benchmark.vector_env()
    env.reset(streams(episodes))
    return env


def actions_of(
    benchmark: Benchmark, episodes: Sequence[int] | np.ndarray, use: str = ""
) -> np.ndarray:
    """(STEPS, n, action): each episode's own, whatever its company."""
    own = [
        benchmark.actions.uniform(stream("actions", use, int(episode)), (STEPS,))
        for episode in episodes
    ]
    return np.stack(own, axis=1)


def achievements(benchmark: Benchmark, env: VectorEnv, rows: np.ndarray) -> np.ndarray:
    """Which skills' goals hold: (n, skills) bool."""
    return np.stack([env.achieved(rows, skill) for skill in range(len(benchmark.skills))], axis=1)


def look(benchmark: Benchmark, env: VectorEnv, rows: np.ndarray) -> tuple[bytes, ...]:
    """All that can be told about these episodes."""
    seen = env.observe(rows), env.snapshot(rows), achievements(benchmark, env, rows)
    return tuple(array.tobytes() for array in seen)


def played(
    benchmark: Benchmark, env: VectorEnv, rows: np.ndarray, actions: np.ndarray
) -> list[tuple[bytes, ...]]:
    """What is seen at the start and after each step."""
    scenes = [look(benchmark, env, rows)]
    for step in actions:
        env.step(rows, step)
        scenes.append(look(benchmark, env, rows))
    return scenes


def midway(benchmark: Benchmark, use: str = "before") -> VectorEnv:
    """An environment with all episodes after some actions."""
    env = started(benchmark)
    played(benchmark, env, ROWS, actions_of(benchmark, ROWS, use))
    return env


class BenchmarkConformance:
    """To be inherited from, with a fixture `benchmark`."""

    def test_skills_are_told_apart(self, benchmark: Benchmark) -> None:
        assert len({skill.name for skill in benchmark.skills}) == len(benchmark.skills) >= 1
        assert not any(">" in skill.name for skill in benchmark.skills)  # joins the names of a task
        table = conditions(benchmark)
        assert table.ndim == 2
        assert table.dtype == np.float32
        assert len(np.unique(table, axis=0)) == len(benchmark.skills)

    def test_shapes_and_types(self, benchmark: Benchmark) -> None:
        env = started(benchmark)
        for rows in (ROWS, ROWS[1:], ROWS[:0]):
            env.step(rows, benchmark.actions.uniform(stream("actions"), (len(rows),)))
            observations, snapshots = env.observe(rows), env.snapshot(rows)
            assert observations.shape == (len(rows), benchmark.observation_size)
            assert observations.dtype == np.float32
            assert snapshots.shape == (len(rows), benchmark.snapshot_size)
            assert snapshots.dtype == np.float64
            for skill in range(len(benchmark.skills)):
                achieved = env.achieved(rows, skill)
                assert achieved.shape == (len(rows),)
                assert achieved.dtype == np.bool_

    def test_what_is_seen_is_finite(self, benchmark: Benchmark) -> None:
        env = started(benchmark)
        for actions in actions_of(benchmark, ROWS):
            assert np.isfinite(env.observe(ROWS)).all()
            env.step(ROWS, actions)
        assert np.isfinite(env.observe(ROWS)).all()
        assert np.isfinite(env.snapshot(ROWS)).all()

    def test_the_start_leaves_something_to_do(self, benchmark: Benchmark) -> None:
        at_start = achievements(benchmark, started(benchmark), ROWS)
        assert not at_start.all(axis=1).any()
        assert (at_start == at_start[0]).all()

    def test_acting_changes_something(self, benchmark: Benchmark) -> None:
        for episode in ROWS:
            row = np.array([episode])
            scenes = played(benchmark, started(benchmark), row, actions_of(benchmark, row))
            assert len(set(scenes)) > 1

    def test_looking_changes_nothing(self, benchmark: Benchmark) -> None:
        """Methods look at the value at different times; the environment must not notice."""
        watched, unwatched = started(benchmark), started(benchmark)
        for actions in actions_of(benchmark, ROWS):
            assert look(benchmark, watched, ROWS) == look(benchmark, watched, ROWS)
            watched.step(ROWS, actions)
            unwatched.step(ROWS, actions)
        assert look(benchmark, watched, ROWS) == look(benchmark, unwatched, ROWS)

    def test_what_is_handed_out_is_a_copy(self, benchmark: Benchmark) -> None:
        env = started(benchmark)
        before = look(benchmark, env, ROWS)
        env.observe(ROWS)[:] = 17
        env.snapshot(ROWS)[:] = 17
        env.achieved(ROWS, 0)[:] = True
        assert look(benchmark, env, ROWS) == before
        kept = env.observe(ROWS), env.snapshot(ROWS)
        bytes_kept = [array.tobytes() for array in kept]
        played(benchmark, env, ROWS, actions_of(benchmark, ROWS))
        assert [array.tobytes() for array in kept] == bytes_kept

    def test_streams_decide_not_the_company(self, benchmark: Benchmark) -> None:
        actions = actions_of(benchmark, ROWS)
        together = played(benchmark, started(benchmark), ROWS, actions)
        np.random.seed(0)  # noqa: NPY002 (the global state must not matter)
        assert played(benchmark, started(benchmark), ROWS, actions) == together

        order = [2, 0]
        env = started(benchmark, order)
        for step, scene in zip([None, *actions], together, strict=True):
            if step is not None:
                env.step(np.arange(2), step[order])
            observations = np.frombuffer(scene[0], dtype=np.float32).reshape(EPISODES, -1)
            snapshots = np.frombuffer(scene[1]).reshape(EPISODES, -1)
            assert env.observe(np.arange(2)).tobytes() == observations[order].tobytes()
            assert env.snapshot(np.arange(2)).tobytes() == snapshots[order].tobytes()

    def test_stepping_some_rows_leaves_the_others(self, benchmark: Benchmark) -> None:
        env = midway(benchmark)
        chosen, others = np.array([1]), np.array([0, 2])
        before = look(benchmark, env, others)
        scenes = played(benchmark, env, chosen, actions_of(benchmark, chosen))
        assert look(benchmark, env, others) == before
        assert len(set(scenes)) > 1

    def test_rows_stepped_apart_go_as_they_would_together(self, benchmark: Benchmark) -> None:
        together, apart = started(benchmark), started(benchmark)
        for actions in actions_of(benchmark, ROWS):
            together.step(ROWS, actions)
            for rows in (np.array([2, 0]), np.array([1])):
                apart.step(rows, actions[rows])
        assert look(benchmark, apart, ROWS) == look(benchmark, together, ROWS)

    def test_a_snapshot_continues_exactly(self, benchmark: Benchmark) -> None:
        """As if nothing had happened, if the noise goes on as it would have."""
        noise = streams()
        env = benchmark.vector_env()
        env.reset(noise)
        played(benchmark, env, ROWS, actions_of(benchmark, ROWS, "before"))

        other = benchmark.vector_env()
        other.restore(env.snapshot(ROWS), copy.deepcopy(noise))
        actions = actions_of(benchmark, ROWS, "after")
        assert played(benchmark, other, ROWS, actions) == played(benchmark, env, ROWS, actions)

    def test_restoring_forgets_all_that_was(self, benchmark: Benchmark) -> None:
        """Workers keep their environments: what was played in one before must not matter."""
        snapshots = midway(benchmark).snapshot(ROWS)
        larger, new = benchmark.vector_env(), benchmark.vector_env()
        used = midway(benchmark, "other")
        larger.reset(streams(range(EPISODES + 2), "larger"))
        scenes = []
        for env in (used, larger, new):
            env.restore(snapshots, streams(use="after"))
            scenes.append(played(benchmark, env, ROWS, actions_of(benchmark, ROWS, "after")))
        assert scenes[0] == scenes[1] == scenes[2]

    def test_resetting_forgets_all_that_was(self, benchmark: Benchmark) -> None:
        used = midway(benchmark)
        used.reset(streams())
        actions = actions_of(benchmark, ROWS)
        new = played(benchmark, started(benchmark), ROWS, actions)
        assert played(benchmark, used, ROWS, actions) == new

    def test_snapshots_survive_their_storage(self, benchmark: Benchmark) -> None:
        snapshots = midway(benchmark).snapshot(ROWS)
        env = benchmark.vector_env()
        stored = np.frombuffer(snapshots.tobytes()).reshape(
            snapshots.shape
        )  # read-only, as from Ray
        env.restore(stored, streams(use="after"))
        assert env.snapshot(ROWS).tobytes() == snapshots.tobytes()
        env.step(ROWS, actions_of(benchmark, ROWS)[0])
        assert stored.tobytes() == snapshots.tobytes()

    def test_some_of_the_snapshots_go_on_alone(self, benchmark: Benchmark) -> None:
        """As in the tree: an episode that failed has no children."""
        snapshots = midway(benchmark).snapshot(ROWS)
        survivors = np.array([2, 1])
        everyone, some = benchmark.vector_env(), benchmark.vector_env()
        everyone.restore(snapshots, streams(use="after"))
        some.restore(snapshots[survivors], streams(survivors, "after"))
        for actions in actions_of(benchmark, ROWS, "after"):
            everyone.step(ROWS, actions)
            some.step(np.arange(2), actions[survivors])
        assert look(benchmark, some, np.arange(2)) == look(benchmark, everyone, survivors)

    def test_an_environment_without_episodes(self, benchmark: Benchmark) -> None:
        env = benchmark.vector_env()
        env.reset([])
        assert env.observe(ROWS[:0]).shape == (0, benchmark.observation_size)
        env.restore(env.snapshot(ROWS[:0]), [])
        assert env.snapshot(ROWS[:0]).shape == (0, benchmark.snapshot_size)

    def test_factors_are_columns_each_of_one_part(self, benchmark: Benchmark) -> None:
        factors, size = benchmark.factors, benchmark.observation_size
        objects = [factors.objects[name] for name in factors.names]
        parts = [factors.pose, *(one.columns for one in objects)]
        columns = [column for part in parts for column in part]
        assert factors.pose
        assert all(one.positions for one in objects)
        assert len(set(columns)) == len(columns)
        assert set(columns) <= set(range(size))
        assert set(factors.own) <= {skill.name for skill in benchmark.skills}
        assert set(factors.own.values()) <= set(factors.objects)

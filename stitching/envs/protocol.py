"""What every benchmark offers: skills, shapes, and many episodes that are stepped together."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from stitching.envs.factors import Factors


@dataclass(frozen=True)
class ActionSpace:
    """Actions of one step, always carried as a float32 vector of length `size`.

    Discrete actions are one-hot, so that one dynamics model and one planner serve both kinds;
    continuous ones lie in [-1, 1]^size.
    """

    size: int
    discrete: bool

    def uniform(self, rng: np.random.Generator, shape: tuple[int, ...]) -> np.ndarray:
        """Uniform random actions, (*shape, size) float32."""
        if self.discrete:
            return np.eye(self.size, dtype=np.float32)[rng.integers(self.size, size=shape)]
        return 2 * rng.random((*shape, self.size), dtype=np.float32) - 1


@dataclass(frozen=True)
class Skill:
    """A named sub-task and the vector that tells a multi-task policy which skill is asked for.

    The vector is the paper's: the goal's coordinates in the maze, a one-hot in Kitchen.
    """

    name: str
    condition: tuple[float, ...]


class VectorEnv(Protocol):
    """N episodes of one benchmark, stepped together. Rows (n,) int64 say which of them are meant.

    It holds no randomness of its own: each episode draws its noise from the stream it was
    handed at `reset` or `restore`, so nothing depends on which worker plays it, or when.
    """

    def reset(self, streams: Sequence[np.random.Generator]) -> None:
        """Put one episode per stream at the benchmark's start state."""

    def restore(self, snapshots: np.ndarray, streams: Sequence[np.random.Generator]) -> None:
        """Continue from snapshots (N, snapshot_size), exactly, with fresh noise streams."""

    def snapshot(self, rows: np.ndarray) -> np.ndarray:
        """All that is needed to go on from a skill boundary: (n, snapshot_size) float64."""

    def observe(self, rows: np.ndarray) -> np.ndarray:
        """Observations (n, observation_size) float32, the skill's condition not included."""

    def step(self, rows: np.ndarray, actions: np.ndarray) -> None:
        """Apply actions (n, action size) float32 to those episodes."""

    def achieved(self, rows: np.ndarray, skill: int) -> np.ndarray:
        """Whether the skill's goal holds now: (n,) bool."""


class Benchmark(Protocol):
    """A family of skills in one simulator."""

    @property
    def name(self) -> str: ...

    @property
    def skills(self) -> tuple[Skill, ...]: ...

    @property
    def observation_size(self) -> int: ...

    @property
    def snapshot_size(self) -> int: ...

    @property
    def actions(self) -> ActionSpace: ...

    @property
    def factors(self) -> Factors: ...

    def vector_env(self) -> VectorEnv:
        """A new environment without episodes: `reset` or `restore` starts them."""


def skill_index(benchmark: Benchmark, name: str) -> int:
    """Position of a skill; ValueError listing the valid names otherwise."""
    names = [skill.name for skill in benchmark.skills]
    if name not in names:
        raise ValueError(f"{benchmark.name} has no skill {name!r}; it has {', '.join(names)}")
    return names.index(name)


def conditions(benchmark: Benchmark) -> np.ndarray:
    """The skills' condition vectors stacked: (skills, condition size) float32."""
    return np.array([skill.condition for skill in benchmark.skills], dtype=np.float32)

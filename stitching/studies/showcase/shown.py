"""What is to be shown: one task, by several methods."""

from __future__ import annotations

from dataclasses import dataclass

from stitching.envs.protocol import Benchmark
from stitching.methods.protocol import Stitcher
from stitching.models.agent import Agent
from stitching.rollout import Block, Recorder, RolloutConfig, Segments, play_from_start


@dataclass(frozen=True)
class Shown:
    """One task as several methods play it, and what it is played with."""

    task: tuple[str, ...]
    agent: Agent
    stitchers: dict[str, Stitcher]  # by method, as a table names it
    rollout: RolloutConfig
    step_limit: int
    root_seed: int
    seed: int

    def play(
        self, benchmark: Benchmark, method: str, episodes: int, recorder: Recorder
    ) -> list[Segments]:
        """The first episodes of the task by a method, as its evaluation plays them."""
        kind, _, _ = method.partition("[")  # streams know no settings
        block = Block(
            self.root_seed, benchmark.name, self.seed, kind, tuple(range(episodes)), self.task
        )
        return play_from_start(
            benchmark.vector_env(),
            self.agent,
            self.stitchers[method],
            benchmark,
            self.rollout,
            block,
            self.step_limit,
            recorder,
        )

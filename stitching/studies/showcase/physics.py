"""One task played by several methods, with what a picture and a value curve need."""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass, field
from typing import Any, Protocol, cast

import numpy as np
import torch

from stitching.envs.protocol import Benchmark, VectorEnv
from stitching.models.agent import Agent
from stitching.planning.objective import spread_over_members
from stitching.rollout import Segments
from stitching.studies.showcase.recorder import simulated
from stitching.studies.showcase.scenery import SCENERIES, Scenery
from stitching.studies.showcase.shown import Shown

EPISODES = 10  # played of the task, of which one is shown


class PhysicsVectorEnv(VectorEnv, Protocol):
    """An environment that MuJoCo steps."""

    def positions(self, rows: np.ndarray) -> np.ndarray:
        """MuJoCo's generalised positions (n, nq): what a renderer needs."""


def _nothing_yet() -> dict[str, Any]:
    return {name: [] for name in ("positions", "skill", "phase", "value", "spread")}


@dataclass
class StepRecorder:
    """Follows every episode: where all things are, and what its skill's value is."""

    benchmark: Benchmark
    agent: Agent
    episodes: dict[int, dict[str, Any]] = field(
        init=False, default_factory=lambda: defaultdict(_nothing_yet)
    )  # by number

    @property
    def scenery(self) -> Scenery | None:
        return SCENERIES.get(self.benchmark.name)

    def scene(self) -> dict[str, Any]:
        """What all episodes have in common, as JSON."""
        model = {"model": self.scenery.model()} if self.scenery else {}
        return {"kind": "physics", "benchmark": self.benchmark.name} | model

    def episode(self, number: int) -> dict[str, Any]:
        """What was recorded of an episode, step by step, as JSON."""
        return self.episodes[number]

    def step(
        self, env: VectorEnv, rows: np.ndarray, episodes: np.ndarray, skill: int, phase: str
    ) -> None:
        env = simulated(env)
        values = self.agent.values(torch.from_numpy(env.observe(rows)), skill)
        spread = spread_over_members(values)
        positions = cast(PhysicsVectorEnv, env).positions(rows)
        told = zip(rows, episodes, positions, values.mean(dim=0), spread, strict=True)
        for row, number, at, mean, std in told:
            episode = self.episodes[number]
            if self.scenery and "fixtures" not in episode:
                episode["fixtures"] = self.scenery.fixtures(env, row)
            episode["positions"].append([round(x, 4) for x in at.tolist()])
            episode["skill"].append(self.benchmark.skills[skill].name)
            episode["phase"].append(phase)
            episode["value"].append(round(float(mean), 4))
            episode["spread"].append(round(float(std), 4))


def physics_showcase(benchmark: Benchmark, shown: Shown) -> dict[str, Any]:
    """The same episode of one task by every method, as JSON.

    Shown is the first of ten episodes in which the last method accomplishes more than the first;
    if there is none, the first of those in which it accomplishes most. Figures say so. The
    benchmark's environments are `PhysicsVectorEnv`s.
    """
    played = {}
    for method in shown.stitchers:
        recorder = StepRecorder(benchmark, shown.agent)
        segments = shown.play(benchmark, method, EPISODES, recorder)
        episodes = [
            recorder.episode(episode) | {"segment": numbers}
            for episode, numbers in enumerate(_segment_numbers(segments))
        ]
        played[method] = episodes, _accomplished(segments)
    scores = [accomplished for _, accomplished in played.values()]
    better = np.flatnonzero(scores[-1] > scores[0])
    number = int(better[0]) if len(better) else int(scores[-1].argmax())
    return recorder.scene() | {
        "task": ">".join(shown.task),
        "episode": number,
        "of_episodes": EPISODES,
        "accomplished_by_all": {m: counts.tolist() for m, (_, counts) in played.items()},
        "episodes": [
            {"method": method, "accomplished": int(accomplished[number]), **episodes[number]}
            for method, (episodes, accomplished) in played.items()
        ],
    }


def _segment_numbers(segments: list[Segments]) -> list[list[int]]:
    """Which of the task's skills each step of each episode belongs to, from 0: one may recur."""
    numbers: list[list[int]] = [[] for _ in range(EPISODES)]
    episodes = np.arange(EPISODES)
    for number, one in enumerate(segments):
        for episode, steps in zip(episodes, one.steps, strict=True):
            numbers[episode] += [number] * int(steps)
        episodes = episodes[one.success]
    return numbers


def _accomplished(segments: list[Segments]) -> np.ndarray:
    """Skills accomplished in each episode, (EPISODES,)."""
    accomplished = np.zeros(EPISODES, dtype=np.int64)
    episodes = np.arange(EPISODES)
    for one in segments:
        episodes = episodes[one.success]
        accomplished[episodes] += 1
    return accomplished

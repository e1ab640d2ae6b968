"""One task played by several methods, with what a picture and a value curve need."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Protocol, cast

import numpy as np
import torch

from stitching.envs.protocol import Benchmark, VectorEnv
from stitching.planning.objective import spread_over_members
from stitching.rollout import Segments
from stitching.studies.showcase.scenery import SCENERIES, Scenery
from stitching.studies.showcase.shown import Shown

EPISODES = 10  # played of the task, of which one is shown


class PhysicsVectorEnv(VectorEnv, Protocol):
    """An environment that MuJoCo steps."""

    def positions(self, rows: np.ndarray) -> np.ndarray:
        """MuJoCo's generalised positions (n, nq): what a renderer needs."""


@dataclass
class StepRecorder:
    """Follows every episode: where all things are, and what its skill's value is."""

    benchmark: Benchmark
    shown: Shown
    scenery: Scenery | None
    episodes: list[dict[str, Any]] = field(init=False)

    def __post_init__(self) -> None:
        names = ("positions", "skill", "phase", "value", "spread")
        self.episodes = [{name: [] for name in names} for _ in range(EPISODES)]

    def step(
        self, env: VectorEnv, rows: np.ndarray, episodes: np.ndarray, skill: int, phase: str
    ) -> None:
        values = self.shown.agent.values(torch.from_numpy(env.observe(rows)), skill)
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
    scenery = SCENERIES.get(benchmark.name)
    played = {}
    for method in shown.stitchers:
        recorder = StepRecorder(benchmark, shown, scenery)
        segments = shown.play(benchmark, method, EPISODES, recorder)
        for episode, numbers in zip(recorder.episodes, _segment_numbers(segments), strict=True):
            episode["segment"] = numbers
        played[method] = recorder.episodes, _accomplished(segments)
    scores = [accomplished for _, accomplished in played.values()]
    better = np.flatnonzero(scores[-1] > scores[0])
    number = int(better[0]) if len(better) else int(scores[-1].argmax())
    return {
        "kind": "physics",
        "benchmark": benchmark.name,
        "task": ">".join(shown.task),
        "episode": number,
        "of_episodes": EPISODES,
        "accomplished_by_all": {m: counts.tolist() for m, (_, counts) in played.items()},
        "episodes": [
            {"method": method, "accomplished": int(accomplished[number]), **episodes[number]}
            for method, (episodes, accomplished) in played.items()
        ],
        **({"model": scenery.model()} if scenery else {}),
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

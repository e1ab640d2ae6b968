"""One Kitchen task played by several methods, with what a picture and a value curve need."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import torch

from stitching.envs.kitchen import KITCHEN, KitchenBlock
from stitching.envs.protocol import EpisodeBlock
from stitching.models.agent import Agent
from stitching.planning.objective import spread_over_members
from stitching.rollout import Play, RolloutConfig, play_from_start
from stitching.stitchers import Stitcher

EPISODES = 10  # played of the task, of which one is shown


@dataclass
class StepRecorder:
    """Follows every episode of a block: where all things are, and what its skill's value is."""

    agent: Agent
    episodes: list[dict[str, list[Any]]] = field(init=False)

    def __post_init__(self) -> None:
        names = ("positions", "skill", "phase", "value", "spread")
        self.episodes = [{name: [] for name in names} for _ in range(EPISODES)]

    def step(
        self, block: EpisodeBlock, rows: np.ndarray, episodes: np.ndarray, skill: int, phase: str
    ) -> None:
        assert isinstance(block, KitchenBlock)
        values = self.agent.values(torch.from_numpy(block.observe(rows)), skill)
        spread = spread_over_members(values)
        for row, at, mean, std in zip(
            episodes, block.positions(rows), values.mean(dim=0), spread, strict=True
        ):
            episode = self.episodes[row]
            episode["positions"].append([round(x, 4) for x in at.tolist()])
            episode["skill"].append(KITCHEN.skills[skill].name)
            episode["phase"].append(phase)
            episode["value"].append(round(float(mean), 4))
            episode["spread"].append(round(float(std), 4))


def kitchen_showcase(
    agent: Agent,
    stitchers: dict[str, Stitcher],
    config: RolloutConfig,
    task: tuple[str, ...],
    step_limit: int,
    root_seed: int,
    seed: int,
) -> dict[str, Any]:
    """The same episode of one task by every method, as JSON.

    Shown is the first of ten episodes in which the last method accomplishes more than the first;
    if there is none, the first episode. Figures say so.
    """
    played = {}
    for method, stitcher in stitchers.items():
        recorder = StepRecorder(agent)
        name, _, _ = method.partition("[")  # streams know no settings
        play = Play(root_seed, KITCHEN.name, seed, name, tuple(range(EPISODES)), task)
        accomplished = _play(recorder, stitcher, config, play, step_limit)
        played[method] = recorder.episodes, accomplished
    scores = [accomplished for _, accomplished in played.values()]
    better = np.flatnonzero(scores[-1] > scores[0])
    shown = int(better[0]) if len(better) else 0
    return {
        "benchmark": KITCHEN.name,
        "task": ">".join(task),
        "episode": shown,
        "of_episodes": EPISODES,
        "accomplished_by_all": {m: counts.tolist() for m, (_, counts) in played.items()},
        "episodes": [
            {"method": method, "accomplished": int(accomplished[shown]), **episodes[shown]}
            for method, (episodes, accomplished) in played.items()
        ],
    }


def _play(
    recorder: StepRecorder, stitcher: Stitcher, config: RolloutConfig, play: Play, step_limit: int
) -> np.ndarray:
    """Skills accomplished in each episode, (EPISODES,)."""
    accomplished = np.zeros(EPISODES, dtype=np.int64)
    segments = play_from_start(
        KITCHEN.block(), recorder.agent, stitcher, KITCHEN, config, play, step_limit, recorder
    )
    episodes = np.arange(EPISODES)
    for one in segments:
        episodes = episodes[one.success]
        accomplished[episodes] += 1
    return accomplished

"""A few recorded episodes for a figure like the paper's Figure 1."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from stitching.data.transitions import Transitions
from stitching.envs.maze import Maze
from stitching.envs.protocol import VectorEnv
from stitching.studies.showcase.recorder import simulated
from stitching.studies.showcase.shown import Shown

DEMONSTRATIONS = 10  # paths shown of each skill


@dataclass
class PathRecorder:
    """Follows every episode through its cells."""

    maze: Maze
    episodes: dict[int, dict[str, Any]] = field(default_factory=dict)  # by number

    def step(
        self, env: VectorEnv, rows: np.ndarray, episodes: np.ndarray, skill: int, phase: str
    ) -> None:
        for number, snapshot in zip(episodes.tolist(), simulated(env).snapshot(rows), strict=True):
            episode = self.episode(number)
            episode["positions"].append([int(x) for x in snapshot])
            episode["phases"].append(phase)
            episode["skills"].append(self.maze.skills[skill].name)

    def scene(self) -> dict[str, Any]:
        """What all episodes have in common, as JSON."""
        return {
            "kind": "map",
            "layout": list(self.maze.layout),
            "spawn": list(self.maze.spawn),
            "goals": {name: list(cell) for name, cell in self.maze.goals},
        }

    def episode(self, number: int) -> dict[str, Any]:
        """What was recorded of an episode, step by step, as JSON."""
        start = list(self.maze.spawn)
        return self.episodes.setdefault(number, {"positions": [start], "phases": [], "skills": []})


def maze_showcase(maze: Maze, demonstrations: Transitions, shown: Shown) -> dict[str, Any]:
    """The map, some demonstrations of each skill, and one task played by each method, as JSON."""
    episodes = []
    for method in shown.stitchers:
        recorder = PathRecorder(maze)
        segments = shown.play(maze, method, 1, recorder)
        episodes.append(
            {
                "method": method,
                "task": ">".join(shown.task),
                **recorder.episode(0),
                "accomplished": int(sum(s.success.sum() for s in segments)),
            }
        )
    return PathRecorder(maze).scene() | {
        "demonstrations": {
            name: [
                _path(maze, demonstrations, rows)
                for rows in demonstrations.episode_rows(skill)[:DEMONSTRATIONS]
            ]
            for skill, (name, _) in enumerate(maze.goals)
        },
        "episodes": episodes,
    }


def _path(maze: Maze, data: Transitions, rows: np.ndarray) -> list[list[int]]:
    """The cells of one demonstration, start and goal included."""
    scaled = np.concatenate([data.observations[rows, :2], data.next_observations[rows[-1:], :2]])
    return np.rint(scaled * len(maze.layout)).astype(int).tolist()

"""A few recorded episodes for a figure like the paper's Figure 1."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from stitching.data.transitions import Transitions
from stitching.envs.maze import Maze
from stitching.envs.protocol import VectorEnv
from stitching.studies.showcase.shown import Shown

DEMONSTRATIONS = 10  # paths shown of each skill


@dataclass
class PathRecorder:
    """Follows the one episode through its cells."""

    maze: Maze
    positions: list[list[int]] = field(default_factory=list)
    phases: list[str] = field(default_factory=list)
    skills: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.positions.append(list(self.maze.spawn))

    def step(
        self, env: VectorEnv, rows: np.ndarray, episodes: np.ndarray, skill: int, phase: str
    ) -> None:
        self.positions.append([int(x) for x in env.snapshot(rows)[0]])
        self.phases.append(phase)
        self.skills.append(self.maze.skills[skill].name)


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
                "positions": recorder.positions,
                "phases": recorder.phases,
                "skills": recorder.skills,
                "accomplished": int(sum(s.success.sum() for s in segments)),
            }
        )
    return {
        "kind": "map",
        "layout": list(maze.layout),
        "spawn": list(maze.spawn),
        "goals": {name: list(cell) for name, cell in maze.goals},
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

"""Files of own data, written as a user would."""

from pathlib import Path

import numpy as np

from stitching.data.maze import MazeDataConfig, skill_demonstrations
from stitching.data.transitions import Transitions
from stitching.envs.maze import MAZE
from stitching.envs.protocol import Benchmark


def maze_demonstrations(episodes: int = 10) -> Transitions:
    """Those that the tiny maze's run learns from, where there are ten of each skill."""
    return skill_demonstrations(MAZE, MazeDataConfig(episodes=episodes), seed=0)


def arrays_of(data: Transitions, benchmark: Benchmark) -> dict[str, np.ndarray]:
    """Episodes that are whole, with their last observations and labels."""
    starts, ends = data.episode_starts, data.episode_ends
    seen = [
        np.vstack([data.observations[start:end], data.next_observations[end - 1 : end]])
        for start, end in zip(starts, ends, strict=True)
    ]
    names = [skill.name for skill in benchmark.skills]
    return {
        "observations": np.concatenate(seen),
        "actions": data.actions,
        "episode_ends": ends,
        "skills": np.array([names[skill] for skill in data.episode_skills]),
        "successes": data.episode_successes,
    }


def write_maze(file: Path, without: str = "", **other: np.ndarray) -> Path:
    """The maze's demonstrations; those of one skill say that they fail, other arrays are other."""
    arrays = arrays_of(maze_demonstrations(), MAZE)
    arrays["successes"] = arrays["skills"] != without
    np.savez(file, **(arrays | other))
    return file


def idle(benchmark: Benchmark, steps: int = 2) -> dict[str, np.ndarray]:
    """An episode of each skill of a benchmark in which nothing happens."""
    episodes = len(benchmark.skills)
    return {
        "observations": np.zeros((episodes * (steps + 1), benchmark.observation_size)),
        "actions": np.zeros((episodes * steps, benchmark.actions.size)),
        "episode_ends": steps * np.arange(1, episodes + 1),
        "skills": np.array([skill.name for skill in benchmark.skills]),
    }

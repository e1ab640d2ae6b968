"""Maze datasets: near-shortest paths from the spawn to each goal, and transitions of all kinds."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from stitching.bounds import Amount, Bounded, Count, Episodes, Share
from stitching.data.transitions import NO_SKILL, Transitions
from stitching.envs.maze import MOVES, Cell, Maze
from stitching.streams import stream


@dataclass(frozen=True)
class MazeDataConfig(Bounded):
    """The maze's demonstrations, and the random walks that dynamics also learn from."""

    episodes: Episodes = 100  # demonstrations a skill
    noise: Share = 0.02  # probability of a random move in them
    exploration_episodes: Amount = 200  # random walks from random cells, for the dynamics
    exploration_steps: Count = 20
    file: str = ""  # own data in place of these: an .npz file or the id of a Minari dataset


def skill_demonstrations(maze: Maze, config: MazeDataConfig, seed: int) -> Transitions:
    """Spawn → goal for every goal: the first shortest move, with a random one now and then.

    Always the *first* shortest move, so that the four skills know narrow tracks of the maze and
    not the whole of it: that is what makes stitching necessary (paper 4.1.1).
    """
    episodes = []
    for skill, (name, goal) in enumerate(maze.goals):
        rng = stream("demonstrations", maze.name, seed, name)
        steps_left = maze.distances(goal)
        for _ in range(config.episodes):
            cells, moves = [maze.spawn], []
            while cells[-1] != goal:
                reached = [tuple(cell) for cell in maze.successors[cells[-1]]]
                move = int(np.argmin([steps_left[cell] for cell in reached]))
                if rng.random() < config.noise:
                    move = int(rng.integers(len(MOVES)))
                moves.append(move)
                cells.append(reached[move])
            episodes.append((cells, moves, skill))
    return _as_transitions(maze, episodes)


def exploration(maze: Maze, config: MazeDataConfig, seed: int) -> Transitions:
    """Random walks from random free cells: "all kinds of transitions in the environment"."""
    rng = stream("exploration", maze.name, seed)
    free = np.argwhere(maze.free)
    episodes = []
    for _ in range(config.exploration_episodes):
        cells = [tuple(free[rng.integers(len(free))])]
        moves = [int(move) for move in rng.integers(len(MOVES), size=config.exploration_steps)]
        for move in moves:
            cells.append(tuple(maze.successors[cells[-1]][move]))
        episodes.append((cells, moves, NO_SKILL))
    return _as_transitions(maze, episodes)


def _as_transitions(maze: Maze, episodes: list[tuple[list[Cell], list[int], int]]) -> Transitions:
    before = np.array([cell for cells, _, _ in episodes for cell in cells[:-1]])
    after = np.array([cell for cells, _, _ in episodes for cell in cells[1:]])
    moves = np.array([move for _, moves, _ in episodes for move in moves])
    skills = np.array([skill for _, _, skill in episodes], dtype=np.int64)
    return Transitions(
        observations=maze.observations[tuple(before.T)],
        actions=np.eye(len(MOVES), dtype=np.float32)[moves],
        next_observations=maze.observations[tuple(after.T)],
        episode_ends=np.cumsum([len(moves) for _, moves, _ in episodes]),
        episode_skills=skills,
        episode_successes=skills != NO_SKILL,
    )

"""MazeRunner: a 9 × 9 grid, four moves, four goals (paper A.1; ancestor: AMAGO's MazeRunner).

The paper does not publish its map or goals. Ours are `MAZE` below; docs/readings.md says how they
were chosen.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from stitching.envs.factors import Factors
from stitching.envs.protocol import ActionSpace, Skill

Cell = tuple[int, int]

MOVES: tuple[Cell, ...] = ((-1, 0), (1, 0), (0, -1), (0, 1))  # up, down, left, right
WALL_DIRECTIONS: tuple[Cell, ...] = ((0, -1), (-1, 0), (0, 1), (1, 0))  # W, N, E, S


@dataclass(frozen=True)
class Maze:
    """One fixed map ('#' wall, '.' free) with its spawn cell and its goals, as (row, column)."""

    layout: tuple[str, ...]
    spawn: Cell
    goals: tuple[tuple[str, Cell], ...]

    name = "maze"
    observation_size = 6  # row and column, then free cells to W, N, E, S; all divided by the side
    snapshot_size = 2
    actions = ActionSpace(size=len(MOVES), discrete=True)
    factors = Factors(pose=(0, 1))

    def __post_init__(self) -> None:
        for name, cell in (("spawn", self.spawn), *self.goals):
            if self.layout[cell[0]][cell[1]] != ".":
                raise ValueError(f"{name} lies in a wall of the maze: row {cell[0]}, {cell[1]}")
        inside = np.zeros_like(self.free)
        inside[1:-1, 1:-1] = True
        if (self.free & ~inside).any():
            raise ValueError("the maze's border must be a wall all round")
        for name, goal in self.goals:
            if np.isinf(self.distances(goal)[self.spawn]):
                raise ValueError(f"no path leads from the spawn to {name}")

    @cached_property
    def skills(self) -> tuple[Skill, ...]:
        side = len(self.layout)
        return tuple(Skill(name, (row / side, col / side)) for name, (row, col) in self.goals)

    @cached_property
    def free(self) -> np.ndarray:
        """(side, side) bool."""
        return np.array([[symbol == "." for symbol in line] for line in self.layout])

    @cached_property
    def successors(self) -> np.ndarray:
        """Cell reached by each move, (side, side, 4, 2) int64; a blocked move stays put."""
        table = np.zeros((*self.free.shape, len(MOVES), 2), dtype=np.int64)
        for row, col in np.argwhere(self.free):
            for move, (down, right) in enumerate(MOVES):
                target = (row + down, col + right)
                table[row, col, move] = target if self.free[target] else (row, col)
        return table

    @cached_property
    def observations(self) -> np.ndarray:
        """What is seen from each cell, (side, side, 6) float32."""
        side = len(self.layout)
        table = np.zeros((side, side, self.observation_size), dtype=np.float32)
        for row, col in np.argwhere(self.free):
            clear = [self._clear_cells(row, col, direction) for direction in WALL_DIRECTIONS]
            table[row, col] = np.array([row, col, *clear]) / side
        return table

    def distances(self, goal: Cell) -> np.ndarray:
        """Moves from each cell to the goal, (side, side) float64; inf in walls and out of reach."""
        steps = np.full(self.free.shape, np.inf)
        steps[goal] = 0
        frontier = deque([goal])
        while frontier:
            row, col = frontier.popleft()
            for down, right in MOVES:
                neighbour = (row + down, col + right)
                if self.free[neighbour] and np.isinf(steps[neighbour]):
                    steps[neighbour] = steps[row, col] + 1
                    frontier.append(neighbour)
        return steps

    def _clear_cells(self, row: int, col: int, direction: Cell) -> int:
        count = 0
        while self.free[row + direction[0], col + direction[1]]:
            row, col, count = row + direction[0], col + direction[1], count + 1
        return count

    def vector_env(self) -> MazeVectorEnv:
        return MazeVectorEnv(self)


class MazeVectorEnv:
    """N agents in one maze. The maze itself is deterministic, so the noise streams go unused."""

    def __init__(self, maze: Maze) -> None:
        self.maze = maze
        self._goals = np.array([cell for _, cell in maze.goals])
        self._cells = np.zeros((0, 2), dtype=np.int64)

    def reset(self, streams: Sequence[np.random.Generator]) -> None:
        self._cells = np.tile(np.array(self.maze.spawn, dtype=np.int64), (len(streams), 1))

    def restore(self, snapshots: np.ndarray, streams: Sequence[np.random.Generator]) -> None:
        self._cells = snapshots.astype(np.int64)

    def snapshot(self, rows: np.ndarray) -> np.ndarray:
        return self._cells[rows].astype(np.float64)

    def observe(self, rows: np.ndarray) -> np.ndarray:
        return self.maze.observations[tuple(self._cells[rows].T)]

    def step(self, rows: np.ndarray, actions: np.ndarray) -> None:
        row, col = self._cells[rows].T
        self._cells[rows] = self.maze.successors[row, col, actions.argmax(axis=1)]

    def achieved(self, rows: np.ndarray, skill: int) -> np.ndarray:
        return (self._cells[rows] == self._goals[skill]).all(axis=1)


MAZE = Maze(
    layout=(
        "#########",
        "#.....#.#",
        "###.#.#.#",
        "#...#...#",
        "#.......#",
        "#..#.#..#",
        "#..#.#..#",
        "#..#.#..#",
        "#########",
    ),
    spawn=(7, 4),
    goals=(("g0", (5, 6)), ("g1", (3, 1)), ("g2", (5, 1)), ("g3", (4, 3))),
)

"""MazeRunner: what is seen and where each move leads, on a map small enough to check by eye."""

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest

from stitching.envs.maze import MAZE, MOVES, Maze, MazeVectorEnv
from stitching.envs.protocol import conditions

UP, DOWN, LEFT, RIGHT = range(4)
SMALL = Maze(
    layout=("#####", "#...#", "#.#.#", "#..##", "#####"),
    spawn=(3, 1),
    goals=(("corner", (1, 3)), ("end", (3, 2))),
)


def at(*cells: tuple[int, int]) -> MazeVectorEnv:
    env = SMALL.vector_env()
    env.restore(np.array(cells, dtype=float), [])
    return env


def moved(cell: tuple[int, int], *moves: int) -> tuple[int, int]:
    env, row = at(cell), np.array([0])
    for move in moves:
        env.step(row, np.eye(4, dtype=np.float32)[[move]])
    return tuple(env.snapshot(row)[0].astype(int).tolist())


@pytest.mark.parametrize(
    ("cell", "clear"),  # free cells to the west, north, east and south
    [
        ((1, 1), (0, 0, 2, 2)),
        ((1, 2), (1, 0, 1, 0)),
        ((1, 3), (2, 0, 0, 1)),
        ((2, 1), (0, 1, 0, 1)),
        ((3, 1), (0, 2, 1, 0)),
        ((3, 2), (1, 0, 0, 0)),
    ],
)
def test_what_is_seen(cell: tuple[int, int], clear: tuple[int, ...]) -> None:
    seen = at(cell).observe(np.array([0]))[0]
    np.testing.assert_array_equal(seen, np.array([*cell, *clear], dtype=np.float32) / 5)


@pytest.mark.parametrize(
    ("cell", "move", "target"),
    [
        ((2, 1), UP, (1, 1)),
        ((2, 1), DOWN, (3, 1)),
        ((1, 2), LEFT, (1, 1)),
        ((1, 2), RIGHT, (1, 3)),
        ((1, 2), UP, (1, 2)),  # the border
        ((1, 2), DOWN, (1, 2)),  # a wall inside
        ((3, 2), RIGHT, (3, 2)),
    ],
)
def test_where_moves_lead(cell: tuple[int, int], move: int, target: tuple[int, int]) -> None:
    assert moved(cell, move) == target


def test_a_way_through() -> None:
    assert moved(SMALL.spawn, UP, UP, RIGHT, RIGHT, DOWN) == (2, 3)


def test_episodes_start_at_the_spawn() -> None:
    env = SMALL.vector_env()
    env.reset([np.random.default_rng(0)] * 3)
    assert env.snapshot(np.arange(3)).tolist() == [[3, 1]] * 3


def test_a_goal_holds_in_its_cell_alone() -> None:
    free = [tuple(cell) for cell in np.argwhere(SMALL.free)]
    env, rows = at(*free), np.arange(len(free))
    for skill, (_, goal) in enumerate(SMALL.goals):
        assert env.achieved(rows, skill).tolist() == [cell == goal for cell in free]


def test_a_skill_is_told_by_its_goal() -> None:
    expected = np.array([[1 / 5, 3 / 5], [3 / 5, 2 / 5]], dtype=np.float32)
    np.testing.assert_array_equal(conditions(SMALL), expected)
    assert [skill.name for skill in SMALL.skills] == ["corner", "end"]


@pytest.mark.parametrize("cell", [(0, 0), (2, 2), (3, 3)])
def test_walls_are_no_place_to_be(cell: tuple[int, int]) -> None:
    with pytest.raises(ValueError, match=f"spawn lies in a wall .* row {cell[0]}, {cell[1]}"):
        replace(SMALL, spawn=cell)
    with pytest.raises(ValueError, match="dead lies in a wall"):
        replace(SMALL, goals=(("dead", cell),))


def test_a_goal_out_of_reach_is_refused() -> None:
    with pytest.raises(ValueError, match="g"):
        Maze(("#####", "#.#.#", "#####"), spawn=(1, 1), goals=(("g", (1, 3)),))


@pytest.mark.parametrize("layout", [("#####", ".....", "#####"), ("##.##", "#...#", "#####")])
def test_an_open_border_is_refused(layout: tuple[str, ...]) -> None:
    with pytest.raises(ValueError, match="border"):
        Maze(layout, spawn=(1, 2), goals=(("g", (1, 1)),))


def test_the_benchmarks_map_is_as_the_paper_says() -> None:
    assert MAZE.free.shape == (9, 9)
    border = np.ones((9, 9), dtype=bool)
    border[1:-1, 1:-1] = False
    assert not MAZE.free[border].any()
    assert len(MAZE.skills) == 4
    assert MAZE.actions.size == 4


def test_the_benchmarks_goals_are_distinct_and_in_reach() -> None:
    cells = [MAZE.spawn, *(goal for _, goal in MAZE.goals)]
    for start, goal in combinations(cells, 2):
        assert 0 < MAZE.distances(goal)[start] < 50 / 4  # four goals in 50 steps can be done


def test_every_free_cell_can_be_told_apart() -> None:
    seen = MAZE.observations[MAZE.free]
    assert len(np.unique(seen, axis=0)) == MAZE.free.sum()
    assert (seen >= 0).all()
    assert (seen < 1).all()


def test_every_move_can_be_taken_back_or_was_blocked() -> None:
    back = {UP: DOWN, DOWN: UP, LEFT: RIGHT, RIGHT: LEFT}
    for cell in np.argwhere(MAZE.free):
        for move in range(len(MOVES)):
            target = MAZE.successors[tuple(cell)][move]
            if not np.array_equal(target, cell):
                assert np.array_equal(MAZE.successors[tuple(target)][back[move]], cell)
                assert np.array_equal(target - cell, MOVES[move])

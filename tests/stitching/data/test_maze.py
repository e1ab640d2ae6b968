"""Maze datasets: true transitions, near-shortest demonstrations, exploration of everything."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from stitching.data.maze import MazeDataConfig, exploration, skill_demonstrations
from stitching.data.transitions import NO_SKILL, Transitions, check
from stitching.envs.maze import MAZE, MOVES, Maze

CONFIG = MazeDataConfig()
SPLIT = Maze(  # the cell in the corner cannot be reached
    layout=("######", "#...##", "#.##.#", "#....#", "######"),
    spawn=(3, 1),
    goals=(("g", (1, 3)),),
)
ISLAND = Maze(
    layout=("#####", "#.#.#", "#..##", "#####"),
    spawn=(1, 1),
    goals=(("g", (2, 2)),),
)


@pytest.fixture(scope="module")
def demonstrations() -> Transitions:
    return skill_demonstrations(MAZE, CONFIG, seed=0)


@pytest.fixture(scope="module")
def explored() -> Transitions:
    return exploration(MAZE, CONFIG, seed=0)


def cells(maze: Maze, observations: np.ndarray) -> list[tuple[int, int]]:
    rounded = np.rint(observations[:, :2] * len(maze.layout)).astype(int)
    return [tuple(cell) for cell in rounded.tolist()]


def rows_of(data: Transitions, episode: int) -> slice:
    return slice(data.episode_starts[episode], data.episode_ends[episode])


def same_bytes(first: Transitions, second: Transitions) -> bool:
    pairs = zip(first.columns().values(), second.columns().values(), strict=True)
    return all(a.tobytes() == b.tobytes() for a, b in pairs)


def relaxed_distances(maze: Maze, goal: tuple[int, int]) -> np.ndarray:
    """Bellman–Ford: relax every edge as often as there are cells."""
    steps = np.full(maze.free.shape, np.inf)
    steps[goal] = 0
    free = [tuple(cell) for cell in np.argwhere(maze.free)]
    for _, (row, col), (down, right) in product(free, free, MOVES):
        if maze.free[row + down, col + right]:
            steps[row, col] = min(steps[row, col], steps[row + down, col + right] + 1)
    return steps


@pytest.mark.parametrize("maze", [MAZE, SPLIT, ISLAND], ids=["benchmark", "split", "island"])
def test_distances(maze: Maze) -> None:
    for _, goal in maze.goals:
        assert np.array_equal(maze.distances(goal), relaxed_distances(maze, goal))


def test_out_of_reach_is_infinite() -> None:
    steps = ISLAND.distances((2, 2))
    assert steps[1, 1] == 2
    assert np.isinf(steps[1, 3])
    assert np.isinf(steps[~ISLAND.free]).all()


@pytest.mark.parametrize("source", ["demonstrations", "explored"])
def test_every_transition_is_the_environments(source: str, request: pytest.FixtureRequest) -> None:
    data: Transitions = request.getfixturevalue(source)
    check(data, MAZE, source)
    env, rows = MAZE.vector_env(), np.arange(len(data))
    env.restore(np.array(cells(MAZE, data.observations), dtype=float), [])
    assert env.observe(rows).tobytes() == data.observations.tobytes()
    env.step(rows, data.actions)
    assert env.observe(rows).tobytes() == data.next_observations.tobytes()


@pytest.mark.parametrize("source", ["demonstrations", "explored"])
def test_episodes_are_unbroken(source: str, request: pytest.FixtureRequest) -> None:
    data: Transitions = request.getfixturevalue(source)
    inside = np.setdiff1d(np.arange(1, len(data)), data.episode_starts)
    assert np.array_equal(data.observations[inside], data.next_observations[inside - 1])


def test_demonstrations_lead_from_the_spawn_to_their_goal(demonstrations: Transitions) -> None:
    data = demonstrations
    assert data.episode_successes.all()
    assert np.bincount(data.episode_skills).tolist() == [CONFIG.episodes] * len(MAZE.goals)
    for episode, skill in enumerate(data.episode_skills):
        path = cells(MAZE, data.next_observations[rows_of(data, episode)])
        assert cells(MAZE, data.observations[rows_of(data, episode)])[0] == MAZE.spawn
        assert path.index(MAZE.goals[skill][1]) == len(path) - 1


def test_demonstrations_are_near_shortest(demonstrations: Transitions) -> None:
    lengths = np.diff(demonstrations.episode_ends, prepend=0)
    for skill, (_, goal) in enumerate(MAZE.goals):
        shortest = MAZE.distances(goal)[MAZE.spawn]
        taken = lengths[demonstrations.episode_skills == skill]
        assert taken.min() == shortest
        # A random move, one in fifty, costs two steps at most.
        assert taken.mean() <= 1.08 * shortest


def test_without_noise_all_take_one_shortest_path() -> None:
    data = skill_demonstrations(MAZE, replace(CONFIG, noise=0.0, episodes=3), seed=0)
    lengths = np.diff(data.episode_ends, prepend=0)
    for skill, (_, goal) in enumerate(MAZE.goals):
        own = np.flatnonzero(data.episode_skills == skill)
        assert (lengths[own] == MAZE.distances(goal)[MAZE.spawn]).all()
        assert len({data.actions[rows_of(data, episode)].tobytes() for episode in own}) == 1


def test_all_noise_is_a_random_walk_that_ends_at_the_goal() -> None:
    data = skill_demonstrations(MAZE, replace(CONFIG, noise=1.0, episodes=5), seed=0)
    frequencies = data.actions.mean(axis=0)
    np.testing.assert_allclose(frequencies, 0.25, atol=0.05)
    assert (np.diff(data.episode_ends, prepend=0) > 0).all()


def test_exploration_tries_every_move_in_every_cell(explored: Transitions) -> None:
    seen = set(
        zip(cells(MAZE, explored.observations), explored.actions.argmax(axis=1), strict=True)
    )
    free = [tuple(cell) for cell in np.argwhere(MAZE.free).tolist()]
    assert seen == set(product(free, range(len(MOVES))))


def test_exploration_demonstrates_nothing(explored: Transitions) -> None:
    assert (explored.episode_skills == NO_SKILL).all()
    assert not explored.episode_successes.any()
    lengths = np.diff(explored.episode_ends, prepend=0)
    assert lengths.tolist() == [CONFIG.exploration_steps] * CONFIG.exploration_episodes


@pytest.mark.parametrize("make", [skill_demonstrations, exploration])
def test_the_seed_decides_everything(make: type) -> None:
    np.random.seed(1)  # noqa: NPY002 (the global state must not matter)
    first = make(MAZE, CONFIG, seed=3)
    np.random.seed(2)  # noqa: NPY002
    assert same_bytes(make(MAZE, CONFIG, seed=3), first)
    assert not same_bytes(make(MAZE, CONFIG, seed=4), first)


def test_a_skill_is_demonstrated_alike_whatever_the_other_goals() -> None:
    data = skill_demonstrations(MAZE, CONFIG, seed=0)
    last = len(MAZE.goals) - 1
    alone = skill_demonstrations(replace(MAZE, goals=MAZE.goals[last:]), CONFIG, seed=0)
    rows = np.concatenate(data.episode_rows(last))
    assert alone.actions.tobytes() == data.actions[rows].tobytes()
    assert alone.observations.tobytes() == data.observations[rows].tobytes()

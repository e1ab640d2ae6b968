"""The recorded episodes behind Figure 1: real cells, real phases, and the play they came from."""

import json
from itertools import pairwise
from typing import Any

import pytest

from stitching.data.maze import MazeDataConfig, skill_demonstrations
from stitching.data.transitions import Transitions
from stitching.envs.maze import Maze
from stitching.methods.protocol import Stitcher
from stitching.models.agent import Agent
from stitching.rollout import RolloutConfig
from stitching.studies.showcase.maze import DEMONSTRATIONS, maze_showcase
from stitching.studies.showcase.shown import Shown

TASK, STEP_LIMIT, CONFIG = ("a", "b", "d"), 40, RolloutConfig(temperature=1.0)


@pytest.fixture(scope="module")
def shown(agent: Agent, stitchers: dict[str, Stitcher]) -> Shown:
    return Shown(TASK, agent, stitchers, CONFIG, STEP_LIMIT, root_seed=0, seed=1)


@pytest.fixture(scope="module")
def scene(maze: Maze, demonstrations: Transitions, shown: Shown) -> dict[str, Any]:
    return maze_showcase(maze, demonstrations, shown)


def are_neighbours(first: list[int], second: list[int]) -> bool:
    return abs(first[0] - second[0]) + abs(first[1] - second[1]) <= 1


def assert_is_a_path(maze: Maze, cells: list[list[int]]) -> None:
    assert all(maze.free[row, col] for row, col in cells)
    assert all(are_neighbours(*pair) for pair in pairwise(cells))


def test_survives_json(scene: dict[str, Any]) -> None:
    assert json.loads(json.dumps(scene)) == scene


def test_draws_the_map(scene: dict[str, Any], maze: Maze) -> None:
    assert scene["layout"] == list(maze.layout)
    assert scene["spawn"] == [5, 2]
    assert scene["goals"] == {"a": [1, 1], "b": [3, 3], "c": [1, 5], "d": [5, 5]}


def test_shows_some_demonstrations_of_each_skill(
    scene: dict[str, Any], maze: Maze, demonstrations: Transitions
) -> None:
    assert list(scene["demonstrations"]) == ["a", "b", "c", "d"]
    for skill, (name, paths) in enumerate(scene["demonstrations"].items()):
        assert len(paths) == DEMONSTRATIONS
        for path, rows in zip(paths, demonstrations.episode_rows(skill), strict=False):
            assert_is_a_path(maze, path)
            assert (path[0], path[-1]) == (scene["spawn"], scene["goals"][name])
            assert len(path) == len(rows) + 1


def test_shows_what_there_is_if_there_is_little(maze: Maze, shown: Shown) -> None:
    few = skill_demonstrations(maze, MazeDataConfig(episodes=2, noise=0.0), seed=0)
    scene = maze_showcase(maze, few, shown)
    assert {len(paths) for paths in scene["demonstrations"].values()} == {2}


def test_one_episode_a_method_from_the_spawn_on(
    scene: dict[str, Any], maze: Maze, stitchers: dict[str, Stitcher]
) -> None:
    assert [episode["method"] for episode in scene["episodes"]] == list(stitchers)
    for episode in scene["episodes"]:
        assert episode["task"] == "a>b>d"
        assert episode["positions"][0] == scene["spawn"]
        assert_is_a_path(maze, episode["positions"])
        steps = len(episode["positions"]) - 1
        assert len(episode["phases"]) == len(episode["skills"]) == steps <= STEP_LIMIT
        assert set(episode["phases"]) <= {"stitch", "execute"}


def test_skills_follow_the_task_each_ending_at_its_goal(scene: dict[str, Any]) -> None:
    for episode in scene["episodes"]:
        played = list(dict.fromkeys(episode["skills"]))
        assert played == list(TASK[: len(played)])
        assert episode["skills"] == sorted(episode["skills"], key=TASK.index)
        assert len(played) <= episode["accomplished"] + 1
        for skill in TASK[: episode["accomplished"]]:
            last = len(episode["skills"]) - episode["skills"][::-1].index(skill)
            assert episode["positions"][last] == scene["goals"][skill]


def test_stitching_comes_first_and_only_between_skills(scene: dict[str, Any]) -> None:
    stitched = set()
    for episode in scene["episodes"]:
        for skill in dict.fromkeys(episode["skills"]):
            phases = [
                phase
                for phase, name in zip(episode["phases"], episode["skills"], strict=True)
                if name == skill
            ]
            assert phases == sorted(phases, reverse=True)  # "stitch" before "execute"
            if "stitch" in phases:
                assert skill != TASK[0]
                stitched.add(episode["method"])
    assert "no-stitch" not in stitched
    assert stitched >= {"random-stitch", "mf-stitch", "mb-stitch"}

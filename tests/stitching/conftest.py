"""A small maze with briefly trained models for the tests of playing; one thread, as in workers."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from hypothesis import settings

from stitching.data.experience import skill_experience
from stitching.data.initiation import initiation_set, pose_scale
from stitching.data.maze import MazeDataConfig, exploration, skill_demonstrations
from stitching.data.mixtures import mixed_experience
from stitching.data.transitions import Transitions, concatenate
from stitching.data.uncut import no_conditions, uncut_experience
from stitching.envs.maze import Maze
from stitching.envs.protocol import conditions
from stitching.methods.mb_stitch import MBStitch, MBStitchSettings
from stitching.methods.mf_stitch import MFStitch, MFStitchSettings
from stitching.methods.no_stitch import NoStitch
from stitching.methods.protocol import Models, Stitcher
from stitching.methods.random_stitch import RandomStitch, RandomStitchSettings
from stitching.methods.reach_stitch import ReachStitch, ReachStitchSettings
from stitching.models.agent import Agent
from stitching.models.dynamics import Dynamics, DynamicsConfig, train_dynamics
from stitching.models.initiation import Initiation
from stitching.models.iql import IQLConfig, train_iql
from stitching.planning.random_shooting import RandomShooting
from tests.sections import with_sections

torch.set_num_threads(1)

settings.register_profile("repeatable", derandomize=True, deadline=None)
settings.load_profile("repeatable")

TRAINING = IQLConfig(updates=250, batch_size=64, members=3, width=32, learning_rate=3e-3, tau=0.05)
DYNAMICS = DynamicsConfig(updates=250, batch_size=64, members=3, width=32, learning_rate=3e-3)


@pytest.fixture(scope="session")
def maze() -> Maze:
    """Not the benchmark's own map: tests of playing must not depend on the choice of that."""
    return Maze(
        layout=("#######", "#.....#", "#.##..#", "#.....#", "#..#..#", "#..#..#", "#######"),
        spawn=(5, 2),
        goals=(("a", (1, 1)), ("b", (3, 3)), ("c", (1, 5)), ("d", (5, 5))),
    )


@pytest.fixture(scope="session")
def demonstrations(maze: Maze) -> Transitions:
    """Noisy enough that later skills often work, but not always."""
    return skill_demonstrations(maze, MazeDataConfig(episodes=40, noise=0.3), seed=0)


@pytest.fixture(scope="session")
def agent(maze: Maze, demonstrations: Transitions) -> Agent:
    experience = skill_experience(demonstrations, conditions(maze))
    trained = train_iql(experience, maze.actions, TRAINING, "agent")
    return Agent(trained.weights, conditions(maze), maze.actions)


@pytest.fixture(scope="session")
def mf_policy(maze: Maze, demonstrations: Transitions) -> Agent:
    experience = mixed_experience(demonstrations, conditions(maze), "halves", TRAINING.gamma)
    trained = train_iql(experience, maze.actions, TRAINING, "mf-policy")
    return Agent(trained.weights, experience.conditions, maze.actions)


@pytest.fixture(scope="session")
def unconditioned(maze: Maze, demonstrations: Transitions) -> Agent:
    """One policy of all demonstrations: it goes to any of the goals."""
    rewards = np.zeros(len(demonstrations), dtype=np.float32)
    rewards[demonstrations.episode_ends - 1] = demonstrations.episode_successes
    trained = train_iql(uncut_experience(demonstrations, rewards), maze.actions, TRAINING, "one")
    return Agent(trained.weights, no_conditions(len(maze.skills)), maze.actions)


@pytest.fixture(scope="session")
def dynamics(maze: Maze, demonstrations: Transitions) -> Dynamics:
    explored = exploration(maze, MazeDataConfig(exploration_episodes=50), seed=0)
    trained = train_dynamics(concatenate([demonstrations, explored]), DYNAMICS, "dynamics")
    return Dynamics(trained.weights, DYNAMICS)


@pytest.fixture(scope="session")
def stitchers(
    maze: Maze,
    demonstrations: Transitions,
    agent: Agent,
    mf_policy: Agent,
    dynamics: Dynamics,
) -> dict[str, Stitcher]:
    """The methods that join skills, and MB-Stitch that plans anew after every action, by name."""
    sets = [initiation_set(demonstrations, maze.factors, skill) for skill in range(4)]
    initiation = Initiation(
        list(maze.factors.pose),
        torch.from_numpy(pose_scale(demonstrations, maze.factors)),
        [torch.from_numpy(one.states) for one in sets],
        [maze.factors.others_than(skill.name) for skill in maze.skills],
        [one.radius for one in sets],
    )
    trained = {
        "agent": agent,
        "dynamics": dynamics,
        "mf-policy": mf_policy,
        "initiation-sets": initiation,
    }
    models = Models(maze.actions, len(maze.skills), trained)
    planner = RandomShooting(population=30, horizon=4)
    often = with_sections(MBStitchSettings(planner="random-shooting"), planner)
    reach = with_sections(ReachStitchSettings(limit=8, planner="random-shooting"), planner)
    return {
        "no-stitch": NoStitch(),
        "random-stitch": RandomStitch(RandomStitchSettings(limit=5), models),
        "mf-stitch": MFStitch(MFStitchSettings(limit=5), models),
        "mb-stitch": MBStitch(replace(often, execute=4), models),
        "mb-stitch[execute=1]": MBStitch(often, models),
        "reach-stitch": ReachStitch(reach, models),
    }

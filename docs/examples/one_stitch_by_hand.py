"""Train two skills of the maze, stitch between them by hand, and watch the next skill's value."""

import numpy as np
import torch

from stitching.data.experience import skill_experience
from stitching.data.maze import MazeDataConfig, exploration, skill_demonstrations
from stitching.data.transitions import concatenate
from stitching.envs.maze import MAZE
from stitching.envs.protocol import conditions
from stitching.methods.mb_stitch import MBStitch, MBStitchSettings
from stitching.methods.protocol import Models
from stitching.models.agent import Agent
from stitching.models.dynamics import Dynamics, DynamicsConfig, train_dynamics
from stitching.models.iql import IQLConfig, train_iql
from stitching.planning.random_shooting import RandomShooting
from stitching.streams import stream

torch.set_num_threads(1)
first, second = 0, 2  # skills by their numbers: g0, then g2

# Learn: skills and values from demonstrations, dynamics from all data.
demonstrations = skill_demonstrations(MAZE, MazeDataConfig(), seed=0)
explored = exploration(MAZE, MazeDataConfig(), seed=0)
experience = skill_experience(demonstrations, conditions(MAZE))
skills = train_iql(experience, MAZE.actions, IQLConfig(updates=1500), "example", "agent")
config = DynamicsConfig(updates=1500)
learned = train_dynamics(concatenate([demonstrations, explored]), config, "example", "dynamics")
agent = Agent(skills.weights, conditions(MAZE), MAZE.actions)
dynamics = Dynamics(learned.weights, config)

# Play the first skill from the start.
env, row = MAZE.vector_env(), np.array([0])
env.reset([stream("example")])
while not env.achieved(row, first)[0]:
    env.step(row, agent.act(torch.from_numpy(env.observe(row)), first, noise=None))

# Stitch: plan towards high, certain value of the second skill, one action at a time.
settings = MBStitchSettings(
    alpha=20.0, planner="random-shooting", random_shooting=RandomShooting(population=200)
)
models = Models(MAZE.actions, len(MAZE.skills), {"agent": agent, "dynamics": dynamics})
stitcher, planning = MBStitch(settings, models), [stream("example", "planner")]
for step in range(stitcher.limit + 1):
    state = torch.from_numpy(env.observe(row))
    values = agent.values(state, second)[:, 0]  # one a member of the ensemble
    print(f"step {step}: V of {MAZE.skills[second].name} {values.mean():.3f} ± {values.std():.3f}")
    env.step(row, stitcher.propose(state, first, second, planning).actions[:, 0])

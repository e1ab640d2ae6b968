"""Read what `skillstitch export RUN --out FOLDER` wrote, and ask a policy and a dynamics model.

python exported_models.py FOLDER      # exported from a run of Table 1
"""

import json
import os
import sys
from pathlib import Path

import minari
import torch
from safetensors.numpy import load_file

from orchestrator.spec.structure import structure
from stitching.envs.maze import MAZE
from stitching.envs.protocol import conditions
from stitching.models.agent import Agent
from stitching.models.dynamics import Dynamics, DynamicsConfig

folder = Path(sys.argv[1])
models = folder / "models"
agent = Agent(load_file(models / "agent-seed-0.safetensors"), conditions(MAZE), MAZE.actions)
config = json.loads((models / "dynamics-seed-0.json").read_text(encoding="utf-8"))["config"]
weights = load_file(models / "dynamics-seed-0.safetensors")
dynamics = Dynamics(weights, structure(DynamicsConfig, config, "dynamics"))

os.environ["MINARI_DATASETS_PATH"] = str(folder / "datasets")
demonstrations = minari.load_dataset("skillstitch/maze-demonstrations-v0")
episode = demonstrations[0]
state = torch.from_numpy(episode.observations[:1])
action = agent.act(state, condition=0, noise=None)
values = agent.values(state, 0)[:, 0]
after = dynamics.imagine(state, torch.from_numpy(action)[:, None]).mean(dim=0)
print(f"{len(demonstrations)} episodes; V of {MAZE.skills[0].name} {values.mean():.3f}")
print(f"from {state[0, :2].numpy()} the policy's action leads to {after[0, :2].numpy().round(2)}")

"""Demonstrations of a robot that moves by a linear law, and of objects that it moves."""

import numpy as np

from stitching.data.transitions import Transitions, concatenate
from stitching.envs.factors import Factors, Object
from stitching.streams import stream

# A robot of two joints (0, 1), a finger that only trembles (2), their velocities (3, 4), a door (5)
# and a cup (6).
FACTORS = Factors(
    (0, 1, 2),
    {"door": Object((5,)), "cup": Object((6,))},
    own={"open": "door", "fill": "cup"},
)
SKILLS = ("open", "fill", "wave")
EFFECT = np.array([[0.1, 0.02], [0.0, 0.05]])  # of two actions on the two joints
SAG = 0.05  # of a joint's distance from 0, lost in a step
STEPS, TOUCHED = 20, 12


def made_up(skill: int, moved: int | None, seed: int) -> Transitions:
    """One episode of a robot that does as it is told; column `moved` moves from step TOUCHED on."""
    rng = stream("made up", skill, seed)
    actions = rng.uniform(-0.6, 0.6, size=(STEPS, 2))
    states = np.zeros((STEPS + 1, 7))
    states[:, [5, 6]] = rng.normal(size=2)
    states[0, :2] = rng.normal(size=2)
    for step, action in enumerate(actions):
        states[step + 1, :2] = (1 - SAG) * states[step, :2] + EFFECT @ action
        states[step + 1, 3:5] = EFFECT @ action
    states[:, 2] = rng.normal(scale=0.01, size=STEPS + 1)
    if moved is not None:
        states[TOUCHED:, moved] += np.linspace(0.2, 1, STEPS + 1 - TOUCHED)
    states = states.astype(np.float32)
    ends, success = np.array([STEPS]), np.array([True])
    actions = actions.astype(np.float32)
    return Transitions(states[:-1], actions, states[1:], ends, np.array([skill]), success)


DATA = concatenate([made_up(skill, (5, 6, None)[skill], n) for skill in range(3) for n in range(8)])

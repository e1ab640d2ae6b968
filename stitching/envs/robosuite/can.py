"""PickPlaceCan, again and again: each can goes into its bin, and then there is another."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import mujoco
import numpy as np

from stitching.envs.protocol import ActionSpace, Skill
from stitching.envs.robosuite.models import ArmModel, arm_model
from stitching.envs.robosuite.vector_env import (
    ACTION_SIZE,
    FACTORS,
    GRIP_POSITION,
    OBSERVATION_SIZE,
    RobosuiteVectorEnv,
    sizes,
)

CAN_POSE, CAN_SPEED = slice(9, 16), slice(9, 15)  # in positions (m, w x y z) and velocities

# Robosuite puts four objects into the first bin, so that none overlaps one before it, and then
# takes all but the can away. Their radius, and from their middle their bottom and top: m.
BIN = np.array([0.1, -0.25, 0.8])
HALF_SIZE = (0.39 / 2 - 0.05, 0.49 / 2 - 0.05)  # of the area that whole objects lie in
SHAPES = (
    (0.025, -0.085, 0.075),  # milk
    (0.03, -0.045, 0.03),  # bread
    (0.04, -0.10, 0.03),  # cereal
    (0.025, -0.06, 0.04),  # can
)

# Where in the second bin a can belongs (m), and how near the gripper must no longer be, by
# robosuite's measure of nearness, 1 − tanh(10 m⁻¹ · distance).
PLACE = np.array([[0.1, 0.28, 0.8], [0.1 + 0.39 / 2, 0.28 + 0.49 / 2, 0.9]])
NEARNESS = 0.6

# Objects in an observation, from its number 11: can in the hand's frame 3 + 4, in the world 3 + 4;
# m, unit quaternions x y z w.
CAN_POSITION = slice(18, 21)


@dataclass(frozen=True)
class Can:
    """One skill, to be used over and over.

    Where an episode is continued with its can in place, the can is gone and a new one lies where
    the episode's stream says. So a task of two cans needs nothing of the rollout but a skill
    boundary between them.
    """

    name = "robosuite-can"
    skills = (Skill("can", (1.0,)),)
    observation_size = OBSERVATION_SIZE
    actions = ActionSpace(size=ACTION_SIZE, discrete=False)
    factors = FACTORS
    fixture_size = 0

    @cached_property
    def arm(self) -> ArmModel:
        return arm_model("PickPlaceCan")

    @cached_property
    def pointing(self) -> np.ndarray:
        """Down, the fingers beside each other along y: as at the start."""
        return np.array([[0.0, 1, 0], [1, 0, 0], [0, 0, -1]])

    @cached_property
    def workspace(self) -> np.ndarray:
        return np.array([[-0.1, -0.45, 0.82], [0.3, 0.5, 1.1]])

    @property
    def snapshot_size(self) -> int:
        return sizes(self.arm.mujoco, self.fixture_size)[1]

    def vector_env(self) -> RobosuiteVectorEnv:
        return RobosuiteVectorEnv(self)

    def start(self, data: mujoco.MjData, rng: np.random.Generator) -> np.ndarray:
        data.qpos[CAN_POSE] = can_pose(rng)
        return np.zeros(0)

    def place(self, fixture: np.ndarray) -> None:
        """Nothing: all is in the state."""

    def resume(self, data: mujoco.MjData, rng: np.random.Generator) -> None:
        if placed(data.qpos[None, CAN_POSE][:, :3], data.site_xpos[None, self.arm.grip])[0]:
            data.qpos[CAN_POSE] = can_pose(rng)
            data.qvel[CAN_SPEED] = data.qacc_warmstart[CAN_SPEED] = 0

    def objects(self, data: mujoco.MjData) -> np.ndarray:
        can, turn = data.qpos[CAN_POSE][:3], data.qpos[CAN_POSE][3:]
        hand, relative, gap = np.empty(4), np.empty(4), np.empty(3)
        mujoco.mju_negQuat(hand, data.xquat[self.arm.hand])
        mujoco.mju_rotVecQuat(gap, can - data.site_xpos[self.arm.grip], hand)
        mujoco.mju_mulQuat(relative, hand, turn)
        relative *= np.copysign(1, relative[0])  # of the two that mean the same, as robosuite
        return np.r_[gap, np.roll(relative, -1), can, np.roll(turn, -1)]

    def achieved(self, observations: np.ndarray, skill: int) -> np.ndarray:
        return placed(observations[:, CAN_POSITION], observations[:, GRIP_POSITION])


def can_pose(rng: np.random.Generator) -> np.ndarray:
    """A start pose of the can, (7,): position m, unit quaternion w x y z."""
    others: list[tuple[np.ndarray, float, float]] = []
    for radius, bottom, top in SHAPES:
        valid = False
        while not valid:
            offset = [rng.uniform(radius - half, half - radius) for half in HALF_SIZE]
            position = BIN + np.array([*offset, -bottom])
            valid = not any(
                np.linalg.norm(position[:2] - other[:2]) <= other_radius + radius
                and position[2] - other[2] <= other_top - bottom
                for other, other_radius, other_top in others
            )
        turn = rng.uniform(0, 2 * np.pi)
        others.append((position, radius, top))
    return np.r_[position, np.cos(turn / 2), 0, 0, np.sin(turn / 2)]


def placed(cans: np.ndarray, grips: np.ndarray) -> np.ndarray:
    """Whether cans (n, 3) lie in their place and are let go of, (n,) bool."""
    inside = ((cans > PLACE[0]) & (cans < PLACE[1])).all(axis=1)
    nearness = 1 - np.tanh(10 * np.linalg.norm(grips - cans, axis=1))
    return inside & (nearness < NEARNESS)


CAN = Can()

"""Door: turn the handle and open it; then close it again."""

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
    OBSERVATION_SIZE,
    RobosuiteVectorEnv,
    sizes,
)

SKILLS = ("open door", "close door")
# rad: open above the one, as robosuite says; closed below the other, which is ours. A door merely
# pushed to stops at 0.182 with its latch against the frame: the handle has to be turned, by 1.25.
OPEN, CLOSED = 0.3, 0.05
WIDEST = 0.4  # rad

# Where the door stands, from robosuite's sampler: uniform in each.
TABLE = np.array([-0.2, -0.35, 0.8])
NEAREST, FARTHEST = np.array([0.07, -0.01]), np.array([0.09, 0.01])  # m from the table's middle
TURNED = (-np.pi / 2 - 0.25, -np.pi / 2)  # rad
HALF_HEIGHT = 0.3  # m

# Objects in an observation, from its number 11: door 3, handle 3, hinge 1 (rad), door from gripper
# 3, handle from gripper 3, turn of the handle 1 (rad); m, in the world.
DOOR_POSITION, HANDLE_POSITION, HINGE, HANDLE_TURN = slice(11, 14), slice(14, 17), 17, 24


@dataclass(frozen=True)
class Door:
    """robosuite's Door, latch and all, and its reverse.

    `starts_open` is for demonstrations of closing: the door begins between open and wide open, the
    arm at home. It is not part of an evaluation, where closing follows opening.
    """

    starts_open: bool = False

    name = "robosuite-door"
    observation_size = OBSERVATION_SIZE
    actions = ActionSpace(size=ACTION_SIZE, discrete=False)
    factors = FACTORS
    fixture_size = 7  # the door's position (m) and unit quaternion (w x y z)

    @property
    def skills(self) -> tuple[Skill, ...]:
        return (Skill(SKILLS[0], (1.0, 0.0)), Skill(SKILLS[1], (0.0, 1.0)))

    @cached_property
    def arm(self) -> ArmModel:
        return arm_model("Door")

    @cached_property
    def pointing(self) -> np.ndarray:
        """At the door, along -y, the fingers one above the other: around the handle."""
        return np.array([[0.0, 1, 0], [0, 0, -1], [-1, 0, 0]])

    @cached_property
    def workspace(self) -> np.ndarray:
        return np.array([[-0.35, -0.4, 0.8], [0.15, 0.15, 1.2]])

    @property
    def snapshot_size(self) -> int:
        return sizes(self.arm.mujoco, self.fixture_size)[1]

    def vector_env(self) -> RobosuiteVectorEnv:
        return RobosuiteVectorEnv(self)

    @cached_property
    def _views(self) -> tuple[np.ndarray, np.ndarray]:
        body = self.arm.mujoco.body("Door_main").id
        return self.arm.mujoco.body_pos[body], self.arm.mujoco.body_quat[body]

    @cached_property
    def _parts(self) -> tuple[int, int]:
        """Body of the door, site of its handle."""
        model = self.arm.mujoco
        return model.body("Door_door").id, model.site("Door_handle").id

    def start(self, data: mujoco.MjData, rng: np.random.Generator) -> np.ndarray:
        offset = [rng.uniform(low, high) for low, high in zip(NEAREST, FARTHEST, strict=True)]
        turn = rng.uniform(*TURNED)
        position = TABLE + np.array([*offset, HALF_HEIGHT])
        if self.starts_open:
            data.qpos[-2] = rng.uniform(OPEN, WIDEST)
        return np.r_[position, np.cos(turn / 2), 0, 0, np.sin(turn / 2)]

    def place(self, fixture: np.ndarray) -> None:
        position, quaternion = self._views
        position[:] = fixture[:3]
        quaternion[:] = fixture[3:]

    def resume(self, data: mujoco.MjData, rng: np.random.Generator) -> None:
        """Nothing: the door stays as it was left."""

    def objects(self, data: mujoco.MjData) -> np.ndarray:
        body, site = self._parts
        door, handle, grip = data.xpos[body], data.site_xpos[site], data.site_xpos[self.arm.grip]
        hinge, latch = data.qpos[-2:]
        return np.r_[door, handle, hinge, door - grip, handle - grip, latch]

    def achieved(self, observations: np.ndarray, skill: int) -> np.ndarray:
        hinge = observations[:, HINGE]
        return hinge > OPEN if SKILLS[skill] == "open door" else hinge < CLOSED


DOOR = Door()

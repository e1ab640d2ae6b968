"""Operational-space control of the gripper's pose (Khatib 1987), as robosuite's OSC_POSE has it.

Its defaults for the Panda: fixed gains, position and orientation decoupled, no interpolation, the
redundant joint drawn towards the posture the episode began in. All episodes of a block at once.
"""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np

from stitching.envs.robosuite.models import ARM

STIFFNESS = 150.0  # 1/s², of the gripper's pose
DAMPING = 2 * np.sqrt(STIFFNESS)  # 1/s
POSTURE_STIFFNESS = 10.0
POSTURE_DAMPING = 2 * np.sqrt(POSTURE_STIFFNESS)

FINGER_SPEED = 0.2  # of the fingers' command, a control step
# Positions held by the fingers' actuators, (2,) m: for commands from -1, open, to 1, closed.
FINGER_MIDDLE, FINGER_SPAN = np.array([0.02, -0.02]), np.array([-0.02, 0.02])


@dataclass(frozen=True)
class Goal:
    position: np.ndarray  # (n, 3) m, in the world
    rotation: np.ndarray  # (n, 3, 3)
    posture: np.ndarray  # (n, 7) rad


class Readings:
    """What the controller measures of n episodes at a substep, in buffers that are reused."""

    def __init__(self, episodes: int, velocities: int) -> None:
        self.mass = np.zeros((episodes, velocities, velocities))
        self.jacobian = np.zeros((episodes, 6, velocities))  # linear, angular
        self.position = np.zeros((episodes, 3))  # m
        self.rotation = np.zeros((episodes, 3, 3))
        self.joints = np.zeros((episodes, ARM))  # rad
        self.speeds = np.zeros((episodes, ARM))  # rad/s
        self.bias = np.zeros((episodes, ARM))  # N m: gravity, Coriolis, centrifugal
        self.linear = [jacobian[:3] for jacobian in self.jacobian]
        self.angular = [jacobian[3:] for jacobian in self.jacobian]


class Body:
    """One episode's `MjData`, and views into it: to ask for each anew costs as much as the law."""

    def __init__(self, model: mujoco.MjModel, grip: int) -> None:
        self.data = data = mujoco.MjData(model)
        self._model, self._grip = model, grip
        self._packed_mass = data.qM
        self._position = data.site_xpos[grip]
        self._rotation = data.site_xmat[grip].reshape(3, 3)
        self._joints, self._speeds = data.qpos[:ARM], data.qvel[:ARM]
        self._bias = data.qfrc_bias[:ARM]
        self.torques, self.fingers = data.ctrl[:ARM], data.ctrl[ARM:]

    def read(self, into: Readings, index: int) -> None:
        data = self.data
        mujoco.mj_jacSite(self._model, data, into.linear[index], into.angular[index], self._grip)
        mujoco.mj_fullM(self._model, into.mass[index], self._packed_mass)
        into.position[index] = self._position
        into.rotation[index] = self._rotation
        into.joints[index] = self._joints
        into.speeds[index] = self._speeds
        into.bias[index] = self._bias


def torques(reading: Readings, goal: Goal) -> np.ndarray:
    """(n, 7) N m, not yet limited.

    With mass M, Jacobian J and Λ = (J M⁻¹ Jᵀ)⁻¹ they are Jᵀ F + M a − Jᵀ Λ J a + bias: F the force
    towards the pose, Λ's blocks of position and of orientation each on their own; a the joints'
    acceleration towards the posture, less what of it would move the gripper.
    """
    M, J = reading.mass[:, :ARM, :ARM], reading.jacobian[:, :, :ARM]
    Jt = J.transpose(0, 2, 1)
    mobility = J @ np.linalg.solve(M, Jt)  # (n, 6, 6): Λ⁻¹
    turn = goal.rotation @ reading.rotation.transpose(0, 2, 1)
    error = np.empty((len(J), 6))
    error[:, :3] = goal.position - reading.position
    error[:, 3] = 0.5 * (turn[:, 2, 1] - turn[:, 1, 2])
    error[:, 4] = 0.5 * (turn[:, 0, 2] - turn[:, 2, 0])
    error[:, 5] = 0.5 * (turn[:, 1, 0] - turn[:, 0, 1])
    wanted = STIFFNESS * error[:, :, None] - DAMPING * (J @ reading.speeds[:, :, None])
    blocks = np.stack((mobility[:, :3, :3], mobility[:, 3:, 3:]), axis=1)
    force = np.linalg.solve(blocks, wanted.reshape(-1, 2, 3, 1)).reshape(-1, 6, 1)
    home = POSTURE_STIFFNESS * (goal.posture - reading.joints) - POSTURE_DAMPING * reading.speeds
    home = home[:, :, None]
    force -= np.linalg.solve(mobility, J @ home)
    return (Jt @ force + M @ home)[:, :, 0] + reading.bias

"""Operational-space control of the gripper's pose (Khatib 1987), as robosuite's OSC_POSE has it.

Its defaults for the Panda: fixed gains, position and orientation decoupled, no interpolation, the
redundant joint drawn towards the posture the episode began in. All episodes at once.
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

AFTER, BEFORE = [2, 0, 1], [1, 2, 0]  # of a rotation's off-diagonal pairs, about x, y, z

FINGER_SPEED = 0.2  # of the fingers' command, a control step
# Positions held by the fingers' actuators, (2,) m: for commands from -1, open, to 1, closed.
FINGER_MIDDLE, FINGER_SPAN = np.array([0.02, -0.02]), np.array([-0.02, 0.02])


@dataclass(frozen=True)
class Goal:
    """Where n hands are to be, and what their arms should look like meanwhile."""

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
        self.velocities = np.zeros((episodes, velocities))  # rad/s, m/s
        self.speeds = self.velocities[:, :ARM]
        self.bias = np.zeros((episodes, ARM))  # N m: gravity, Coriolis, centrifugal
        self.linear = [jacobian[:3] for jacobian in self.jacobian]
        self.angular = [jacobian[3:] for jacobian in self.jacobian]

    def forget(self, unsound: np.ndarray) -> None:
        """Put numbers that can be computed with in the place of these episodes', (n,) bool."""
        self.mass[unsound] = np.eye(self.mass.shape[-1])
        self.jacobian[unsound] = np.eye(6, self.mass.shape[-1])
        for array in (self.position, self.rotation, self.joints, self.velocities, self.bias):
            array[unsound] = 0


class Body:
    """One episode's `MjData`, and views into it: to ask for each anew costs as much as the law."""

    def __init__(self, model: mujoco.MjModel, grip: int) -> None:
        self.data = data = mujoco.MjData(model)
        self._model, self._grip = model, grip
        self._packed_mass = data.qM
        self._position = data.site_xpos[grip]
        self._rotation = data.site_xmat[grip].reshape(3, 3)
        self._joints, self._velocities = data.qpos[:ARM], data.qvel
        self._bias = data.qfrc_bias[:ARM]
        self.torques, self.fingers = data.ctrl[:ARM], data.ctrl[ARM:]

    def read(self, into: Readings, index: int) -> None:
        data = self.data
        mujoco.mj_jacSite(self._model, data, into.linear[index], into.angular[index], self._grip)
        mujoco.mj_fullM(self._model, into.mass[index], self._packed_mass)
        into.position[index] = self._position
        into.rotation[index] = self._rotation
        into.joints[index] = self._joints
        into.velocities[index] = self._velocities
        into.bias[index] = self._bias


def torques(reading: Readings, goal: Goal) -> np.ndarray:
    """(n, 7) N m, not yet limited.

    With mass M, Jacobian J and Λ = (J M⁻¹ Jᵀ)⁻¹ they are Jᵀ F + M a − Jᵀ Λ J a + bias: F the force
    towards the pose, Λ's blocks of position and of orientation each on their own; a the joints'
    acceleration towards the posture, less what of it would move the gripper.
    """
    M, J = reading.mass[:, :ARM, :ARM], reading.jacobian[:, :, :ARM]
    Jt = J.transpose(0, 2, 1)
    home = POSTURE_STIFFNESS * (goal.posture - reading.joints) - POSTURE_DAMPING * reading.speeds
    home = home[:, :, None]
    turn = goal.rotation @ reading.rotation.transpose(0, 2, 1)
    error = np.empty((len(J), 6, 1))
    error[:, :3, 0] = goal.position - reading.position
    error[:, 3:, 0] = 0.5 * (turn[:, AFTER, BEFORE] - turn[:, BEFORE, AFTER])
    # Λ⁻¹, once in blocks for what the pose wants and once whole for what the posture must not do.
    mobility, wanted = np.zeros((len(J), 2, 6, 6)), np.empty((len(J), 2, 6, 1))
    whole = mobility[:, 1]
    np.matmul(J, np.linalg.solve(M, Jt), out=whole)
    mobility[:, 0, :3, :3] = whole[:, :3, :3]
    mobility[:, 0, 3:, 3:] = whole[:, 3:, 3:]
    wanted[:, 0] = STIFFNESS * error - DAMPING * (J @ reading.speeds[:, :, None])
    wanted[:, 1] = J @ home
    force = np.linalg.solve(mobility, wanted)
    return (Jt @ (force[:, 0] - force[:, 1]) + M @ home)[:, :, 0] + reading.bias

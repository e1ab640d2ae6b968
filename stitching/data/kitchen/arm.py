"""The arm as a demonstrator sees it: where the hand is, and the action that moves it."""

from __future__ import annotations

import mujoco
import numpy as np
import scipy  # loads its parts when they are used

from stitching.envs.kitchen import JOINTS, START, STEP_SECONDS, TOP_SPEED, kitchen_model

ARM = 7  # joints before the two fingers
HOME = np.array(START[:ARM])
GRIP_OPEN, GRIP_CLOSED = 0.04, 0.0  # m, each finger
STRIDE = TOP_SPEED * STEP_SECONDS  # rad, or m of a finger, asked for by an action of 1

# The hand level and pointing away from the robot (+y), fingers side by side along x. Columns are
# the axes of the `end_effector` site: x up, y to the right, z out of the palm.
LEVEL = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])

DAMPING = 0.05  # of the least squares, in m
TURN_WEIGHT = 0.25  # m of position error that one rad of orientation error is worth
TURN_SPEED = 0.15  # rad a step
POSTURE_PULL = 0.3  # towards home, of what the hand's pose leaves free, a step


def hand_turn(yaw: float, pitch: float, roll: float) -> scipy.spatial.transform.Rotation:
    """The hand's orientation: turned left by yaw, its tip up by pitch, about itself by roll."""
    Rotation = scipy.spatial.transform.Rotation
    level = Rotation.from_matrix(LEVEL)
    return Rotation.from_euler("ZX", [yaw, pitch]) * level * Rotation.from_euler("z", roll)


class Arm:
    """Kinematics on a state of its own, filled from an observation; no simulation."""

    def __init__(self) -> None:
        self._model = kitchen_model()
        self._data = mujoco.MjData(self._model)
        self._hand = self._model.site("end_effector").id
        self._limits = self._model.jnt_range[:ARM].T  # rad, lower and upper, (2, 7)
        self._stiffness = self._model.actuator_gainprm[:ARM, 0]

    def see(self, observation: np.ndarray) -> None:
        self._data.qpos[:] = np.r_[observation[:JOINTS], observation[18:39]]
        mujoco.mj_kinematics(self._model, self._data)
        mujoco.mj_comPos(self._model, self._data)

    @property
    def joints(self) -> np.ndarray:
        return self._data.qpos[:ARM]

    @property
    def position(self) -> np.ndarray:
        return self._data.site_xpos[self._hand].copy()

    @property
    def turn(self) -> scipy.spatial.transform.Rotation:
        return scipy.spatial.transform.Rotation.from_matrix(
            self._data.site_xmat[self._hand].reshape(3, 3)
        )

    def site(self, name: str) -> np.ndarray:
        return self._data.site(name).xpos.copy()

    def reach(
        self,
        position: np.ndarray,
        turn: scipy.spatial.transform.Rotation,
        speed: float,
        grip: float,
    ) -> np.ndarray:
        """Action (9,) that moves the hand towards a pose by at most `speed` m.

        Damped least squares on the pose (Wampler 1986); what that leaves free goes home.
        """
        jacobian = np.zeros((6, self._model.nv))
        mujoco.mj_jacSite(self._model, self._data, jacobian[:3], jacobian[3:], self._hand)
        weights = np.r_[np.ones(3), np.full(3, TURN_WEIGHT)]
        J = weights[:, None] * jacobian[:, :ARM]
        move = _shortened(position - self.position, speed)
        rotate = _shortened((turn * self.turn.inv()).as_rotvec(), TURN_SPEED)
        error = weights * np.r_[move, rotate]
        change, held = np.zeros(ARM), np.zeros(ARM, dtype=bool)
        # A joint that would pass its limit stops there, and the others make up for it.
        for _ in range(ARM):
            rest = np.where(held, 0, J)
            inverse = rest.T @ np.linalg.inv(rest @ rest.T + DAMPING**2 * np.eye(6))
            pull = POSTURE_PULL * np.where(held, 0, HOME - self.joints)
            wanted = inverse @ (error - J @ (held * change)) + pull - inverse @ (rest @ pull)
            change = np.where(held, change, wanted)
            low, high = self._limits - self.joints
            beyond = ~held & ((change < low) | (change > high))
            if not beyond.any():
                break
            change, held = np.clip(change, low, high), held | beyond
        return self.bend(change, grip)

    def bend(self, change: np.ndarray, grip: float) -> np.ndarray:
        """Action (9,) that changes the joints by (7,) rad, in proportion if that is too fast."""
        weight = np.zeros(self._model.nv)
        mujoco.mj_rne(self._model, self._data, 0, weight)
        # The joints hold their targets like springs, so the arm would sag under its own weight.
        change = change + weight[:ARM] / self._stiffness
        fingers = (grip - self._data.qpos[ARM:JOINTS]) / STRIDE
        return np.r_[change / max(STRIDE, np.abs(change).max()), fingers]


def _shortened(vector: np.ndarray, length: float) -> np.ndarray:
    return vector * min(1.0, length / max(float(np.linalg.norm(vector)), 1e-9))

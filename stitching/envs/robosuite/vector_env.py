"""N episodes of a robosuite task, each with an `MjData` of its own on one compiled model."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import mujoco
import numpy as np

from stitching.envs.factors import Factors
from stitching.envs.robosuite.control import (
    FINGER_MIDDLE,
    FINGER_SPAN,
    FINGER_SPEED,
    Body,
    Goal,
    Readings,
    torques,
)
from stitching.envs.robosuite.models import ARM, FINGERS, FINGERS_HOME, HOME, ArmModel

START_NOISE = 0.02  # rad, standard deviation of each joint at the start

# An action asks for a pose of the gripper, which points where the scene says: x, y, z in the
# scene's workspace, a turn about its own axis, and to open (below 0) or close the fingers.
ACTION_SIZE = 5
TURN = np.pi / 2  # rad, of an action of 1

CONTROL_STEPS = 5  # at most, an action
SUBSTEPS = 50  # of 2 ms, a control step
STRIDE = 0.1  # m, from where the gripper is to where the controller is asked to have it next
NEAR = 0.01  # m, and
AHEAD = 0.05  # rad, from the pose asked for: arrived

# What an observation's first numbers are of; the scene's objects follow, 14 numbers.
OBSERVATION_SIZE = 25
GRIP_POSITION = slice(0, 3)  # m
HAND_QUATERNION = slice(3, 7)  # x y z w; of the hand's body, a quarter turn from the gripper
FINGER_POSITIONS = slice(7, 9)  # m
FINGER_SPEEDS = slice(9, 11)  # m/s
OBJECTS = slice(11, 25)
GROUPS = {"gripper": slice(0, 11), "objects": OBJECTS}
# The pose is what an action can bring back. The hand's quaternion is left out, for it has the
# tilt, which no action changes; the turn, which an action sets, is lost with it. There is no
# object, since objects are told relative to the gripper, too.
FACTORS = Factors(pose=(0, 1, 2, 7, 8))

# What the next substep depends on, the solver's warm start included.
PHYSICS = int(mujoco.mjtState.mjSTATE_PHYSICS) | int(mujoco.mjtState.mjSTATE_WARMSTART)

TOO_FAST = 1e6  # m/s or rad/s: physics have diverged

# Warnings on which MuJoCo would reset a state to the model's default pose.
RESETTING = [
    int(mujoco.mjtWarning.mjWARN_BADQPOS),
    int(mujoco.mjtWarning.mjWARN_BADQVEL),
    int(mujoco.mjtWarning.mjWARN_BADQACC),
]


class Scene(Protocol):
    """What stands around the arm."""

    @property
    def arm(self) -> ArmModel: ...

    @property
    def workspace(self) -> np.ndarray:
        """(2, 3) m: where the gripper may be sent, lower and upper corner."""

    @property
    def pointing(self) -> np.ndarray:
        """(3, 3) the gripper's axes, as columns, where its turn is 0; it points along the third."""

    @property
    def fixture_size(self) -> int:
        """How many numbers tell where things stand that are the model's, not the state's."""

    def start(self, data: mujoco.MjData, rng: np.random.Generator) -> np.ndarray:
        """Put the objects at their start; returns the fixture (fixture_size,)."""

    def place(self, fixture: np.ndarray) -> None:
        """Make the model an episode's."""

    def resume(self, data: mujoco.MjData, rng: np.random.Generator) -> None:
        """What happens to the objects at a skill boundary; `data` has its kinematics."""

    def objects(self, data: mujoco.MjData) -> np.ndarray:
        """(14,) what is seen of them."""

    def achieved(self, observations: np.ndarray, skill: int) -> np.ndarray:
        """Whether the skill's goal holds, (n,) bool, from what is seen, (n, 25) float64."""


def sizes(model: mujoco.MjModel, fixture: int) -> tuple[int, int]:
    """Of a state of the physics, and of a snapshot: fingers' command, posture, fixture added."""
    physics = mujoco.mj_stateSize(model, PHYSICS)
    return physics, physics + 1 + ARM + fixture


class RobosuiteVectorEnv:
    """Episodes of a scene, kept and reused from one use to the next.

    Beside the physics an episode's state is the fingers' command, which robosuite ramps by 0.2 a
    control step; the posture that the redundant joint is drawn to, its noisy start; and where
    things stand that are part of the model. The controller has no other memory between actions. An
    observation is a function of the state: there is no noise in it.

    Physics that diverge (too fast, or where MuJoCo would reset the state) end their episode and no
    other: `diverged` (N,) says so, the episode keeps its last sound observation, no step moves it,
    no goal holds in it, and its snapshot is NaN and not accepted back.
    """

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        self._physics, self._size = sizes(scene.arm.mujoco, scene.fixture_size)
        self.diverged = np.zeros(0, dtype=bool)
        self._pool: list[Body] = []
        self._commands = np.zeros(0)
        self._postures = np.zeros((0, ARM))
        self._fixtures = np.zeros((0, scene.fixture_size))
        self._seen = np.zeros((0, OBSERVATION_SIZE))

    def reset(self, streams: Sequence[np.random.Generator]) -> None:
        self._begin(len(streams))
        for row, rng in enumerate(streams):
            data = self._pool[row].data
            data.qpos[:ARM] = HOME + START_NOISE * rng.standard_normal(ARM)
            data.qpos[FINGERS] = FINGERS_HOME
            self._postures[row] = data.qpos[:ARM]
            self._fixtures[row] = self.scene.start(data, rng)
        self._look(np.arange(len(streams)))

    def restore(self, snapshots: np.ndarray, streams: Sequence[np.random.Generator]) -> None:
        if not np.isfinite(snapshots).all():
            raise ValueError("a robosuite snapshot is not finite: its episode had diverged")
        self._begin(len(streams))
        model = self.scene.arm.mujoco
        for row, (snapshot, rng) in enumerate(zip(snapshots, streams, strict=True)):
            data, rest = self._pool[row].data, snapshot[self._physics :]
            mujoco.mj_setState(model, data, snapshot[: self._physics], PHYSICS)
            self._commands[row] = rest[0]
            self._postures[row] = rest[1 : 1 + ARM]
            self._fixtures[row] = rest[1 + ARM :]
            self._kinematics(row)
            self.scene.resume(data, rng)
        self._look(np.arange(len(streams)))

    def _begin(self, episodes: int) -> None:
        arm = self.scene.arm
        missing = range(episodes - len(self._pool))
        self._pool += [Body(arm.mujoco, arm.grip) for _ in missing]
        for body in self._pool[:episodes]:
            mujoco.mj_resetData(arm.mujoco, body.data)  # clears its warnings
        self.diverged = np.zeros(episodes, dtype=bool)
        self._commands = np.zeros(episodes)
        self._postures = np.zeros((episodes, ARM))
        self._fixtures = np.zeros((episodes, self.scene.fixture_size))
        self._seen = np.zeros((episodes, OBSERVATION_SIZE))

    def snapshot(self, rows: np.ndarray) -> np.ndarray:
        snapshots = np.full((len(rows), self._size), np.nan)
        for row, snapshot in zip(rows.tolist(), snapshots, strict=True):
            if not self.diverged[row]:
                physics, rest = snapshot[: self._physics], snapshot[self._physics :]
                mujoco.mj_getState(self.scene.arm.mujoco, self._pool[row].data, physics, PHYSICS)
                rest[0] = self._commands[row]
                rest[1 : 1 + ARM] = self._postures[row]
                rest[1 + ARM :] = self._fixtures[row]
        return snapshots

    def observe(self, rows: np.ndarray) -> np.ndarray:
        return self._seen[rows].astype(np.float32)

    def positions(self, rows: np.ndarray) -> np.ndarray:
        """Generalised positions (n, nq), for tests and pictures."""
        return np.array([self._pool[row].data.qpos for row in rows.tolist()])

    def achieved(self, rows: np.ndarray, skill: int) -> np.ndarray:
        return self.scene.achieved(self._seen[rows], skill) & ~self.diverged[rows]

    def step(self, rows: np.ndarray, actions: np.ndarray) -> None:
        if not np.isfinite(actions).all():
            raise ValueError("a robosuite action is not finite: what proposed it is broken")
        alive = ~self.diverged[rows]
        rows = going = rows[alive]
        positions, rotations, closing = poses(self.scene, actions[alive])
        for _ in range(CONTROL_STEPS):
            arrived = self._control(going, positions, rotations, closing)
            left = ~arrived & ~self.diverged[going]
            going = going[left]
            positions, rotations, closing = positions[left], rotations[left], closing[left]
            if not len(going):
                break
        self._look(rows[~self.diverged[rows]])

    def _control(
        self, rows: np.ndarray, positions: np.ndarray, rotations: np.ndarray, closing: np.ndarray
    ) -> np.ndarray:
        """One control step towards poses; (n,) bool whether they are reached."""
        model, place = self.scene.arm.mujoco, self.scene.place
        fixtures = list(self._fixtures[rows])
        bodies = [self._pool[row] for row in rows.tolist()]
        commands = np.clip(self._commands[rows] + FINGER_SPEED * closing, -1, 1)
        self._commands[rows] = commands
        for body, fingers in zip(bodies, fingers_at(commands), strict=True):
            body.fingers[:] = fingers
        reading = Readings(len(rows), model.nv)
        goal = Goal(positions, rotations, self._postures[rows])
        low, high = self.scene.arm.torque_limits
        for substep in range(SUBSTEPS):
            for index, (body, fixture) in enumerate(zip(bodies, fixtures, strict=True)):
                place(fixture)
                mujoco.mj_step1(model, body.data)
                body.read(reading, index)
            sound = np.abs(reading.velocities) < TOO_FAST  # False for NaN
            if not sound.all():  # else the controller's solver would refuse the others too
                wild = ~sound.all(axis=1)
                self.diverged[rows[wild]] = True
                reading.forget(wild)
            if substep == 0:
                goal = Goal(stride(reading.position, positions), rotations, goal.posture)
            wanted = np.minimum(np.maximum(torques(reading, goal), low), high)
            for body, torque in zip(bodies, wanted, strict=True):
                body.torques[:] = torque
                mujoco.mj_step2(model, body.data)
        self._check(rows)
        return arrived(reading, positions, rotations) & (np.abs(commands) == 1)

    def _check(self, rows: np.ndarray) -> None:
        for row in rows.tolist():
            data = self._pool[row].data
            bounded = (np.abs(np.r_[data.qpos, data.qvel]) <= mujoco.mjMAXVAL).all()  # not if NaN
            self.diverged[row] |= not bounded or data.warning.number[RESETTING].any()

    def _kinematics(self, row: int) -> mujoco.MjData:
        self.scene.place(self._fixtures[row])
        data = self._pool[row].data
        mujoco.mj_kinematics(self.scene.arm.mujoco, data)
        return data

    def _look(self, rows: np.ndarray) -> None:
        arm = self.scene.arm
        for row in rows.tolist():
            data, seen = self._kinematics(row), self._seen[row]
            seen[GRIP_POSITION] = data.site_xpos[arm.grip]
            seen[HAND_QUATERNION] = np.roll(data.xquat[arm.hand], -1)
            seen[FINGER_POSITIONS] = data.qpos[FINGERS]
            seen[FINGER_SPEEDS] = data.qvel[FINGERS]
            seen[OBJECTS] = self.scene.objects(data)


def poses(scene: Scene, actions: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """What actions (n, 5) ask for: positions (n, 3) m, rotations (n, 3, 3), fingers (n,) ±1."""
    actions = np.clip(actions.astype(np.float64), -1, 1)
    low, high = scene.workspace
    turn = TURN * actions[:, 3]
    turns = np.zeros((len(actions), 3, 3))
    turns[:, 0, 0] = turns[:, 1, 1] = np.cos(turn)
    turns[:, 1, 0] = np.sin(turn)
    turns[:, 0, 1] = -turns[:, 1, 0]
    turns[:, 2, 2] = 1
    closing = np.where(actions[:, 4] > 0, 1.0, -1.0)
    return low + (high - low) * (actions[:, :3] + 1) / 2, scene.pointing @ turns, closing


def stride(here: np.ndarray, there: np.ndarray) -> np.ndarray:
    """Where to have the gripper next, (n, 3): straight ahead, a stride at most."""
    gap = there - here
    length = np.sqrt((gap * gap).sum(axis=1, keepdims=True))
    return here + gap * np.minimum(1, STRIDE / np.maximum(length, STRIDE))


def fingers_at(commands: np.ndarray) -> np.ndarray:
    """Positions that the fingers are to hold, (n, 2) m."""
    return FINGER_MIDDLE + FINGER_SPAN * commands[:, None]


def arrived(reading: Readings, positions: np.ndarray, rotations: np.ndarray) -> np.ndarray:
    """Which of n goals an arm is at: (n, 3) m and (n, 3, 3) → (n,) bool."""
    gap = positions - reading.position
    cosine = ((rotations * reading.rotation).sum(axis=(1, 2)) - 1) / 2
    return ((gap * gap).sum(axis=1) < NEAR**2) & (cosine > np.cos(AHEAD))

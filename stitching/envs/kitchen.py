"""FrankaKitchen-v1: a 9-joint arm, seven things to do, all episodes on one model.

The benchmark of Relay Policy Learning (Gupta et al. 2019, arXiv:1910.11956) as gymnasium-robotics
1.4.2 has it; its model file and noise table are read from there. An episode equals the
original's bit for bit, given the same actions and a generator in the same state. What differs is
by intent: success is told from the goal distances of the current state alone, and physics that
diverge end their episode, where the original goes on from MuJoCo's silent reset.

One step is 40 substeps of 2 ms, 0.08 s. Angles in rad, lengths in m, velocities per s.
Generalised positions (30): 0:7 arm, 7:9 fingers (m), 9:17 four pairs of knob and burner (rad, m),
17:19 light switch and lamp, 19 slide cabinet (m), 20:22 hinge cabinet's left and right door,
22 microwave door, 23:30 kettle (position in m, unit quaternion w x y z). Velocities (29) alike,
save that the kettle's are 23:29: linear, angular.
"""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache, cached_property
from importlib.util import find_spec
from pathlib import Path
from xml.etree import ElementTree

import mujoco
import numpy as np

from stitching.envs.factors import Factors, Object
from stitching.envs.protocol import ActionSpace, Skill

POSITIONS, VELOCITIES = 30, 29  # MuJoCo's nq and nv
JOINTS = 9  # of the robot; they come first in both
SUBSTEPS = 40
STEP_SECONDS = 0.08
TOP_SPEED = 2.0  # of an action of 1: rad/s for the arm, m/s for the fingers
GOAL_RADIUS = 0.3

# Where each skill's objects lie in the positions, and where they shall be.
GOALS: dict[str, tuple[slice, tuple[float, ...]]] = {
    "bottom burner": (slice(11, 13), (-0.88, -0.01)),
    "top burner": (slice(15, 17), (-0.92, -0.01)),
    "light switch": (slice(17, 19), (-0.69, -0.05)),
    "slide cabinet": (slice(19, 20), (0.37,)),
    "hinge cabinet": (slice(20, 22), (0.0, 1.45)),
    "microwave": (slice(22, 23), (-0.75,)),
    "kettle": (slice(23, 30), (-0.23, 0.75, 1.62, 0.99, 0.0, 0.0, -0.06)),
}
SKILLS = tuple(GOALS)
IDLE = {"burner 1": slice(9, 11), "burner 3": slice(13, 15)}  # no skill is about them

# fmt: off
START = (
    0.148388023, -1.76848573, 1.84390296, -2.4768576, 0.260252026, 0.712533105, 1.59515394,
    0.0479267505, 0.0371350919,
    -2.6627985e-04, -5.18043486e-05, 3.1287722e-05, -4.51199853e-05,
    -3.90842156e-06, -4.22629655e-05, 6.28065475e-05, 4.04984708e-05,
    4.62730939e-04, -2.26906415e-04, -4.65501369e-04, -6.44129196e-03, -1.77048263e-03,
    1.08009684e-03,
    -0.26939744, 0.350383255, 1.61944683, 1.00618764, 4.06395120e-03, -6.62095997e-03,
    -2.68278933e-04,
)
# fmt: on

# An observation shows the robot's positions and velocities, then everything else's.
SEEN = np.r_[0:9, 30:39, 9:30, 39:59]  # in positions and velocities joined

# What an observation's numbers are of.
GROUPS = {
    "arm positions": slice(0, 9),
    "arm velocities": slice(9, 18),
    "object positions": slice(18, 39),
    "object velocities": slice(39, 59),
}

# What the next substep depends on: positions, velocities, and the solver's warm start (29). Without
# the last a restored state drifts as soon as something touches. Time, control, applied forces and
# equality switches belong to MuJoCo's mjSTATE_INTEGRATION too, but here they are without effect,
# set anew by each step, or never set.
PHYSICS = int(mujoco.mjtState.mjSTATE_PHYSICS) | int(mujoco.mjtState.mjSTATE_WARMSTART)
PHYSICS_SIZE = POSITIONS + 2 * VELOCITIES

# Warnings on which MuJoCo would reset a state to the model's default pose.
RESETTING = [
    int(mujoco.mjtWarning.mjWARN_BADQPOS),
    int(mujoco.mjtWarning.mjWARN_BADQVEL),
    int(mujoco.mjtWarning.mjWARN_BADQACC),
]


def _columns(numbers: range) -> tuple[int, ...]:
    """Where an observation shows these of the positions and velocities joined."""
    return tuple(np.flatnonzero(np.isin(SEEN, numbers)).tolist())


@dataclass(frozen=True)
class Kitchen:
    """The seven-skill kitchen, with how strongly its observations are blurred."""

    robot_noise_ratio: float = 0.01
    object_noise_ratio: float = 0.0005

    name = "kitchen"
    observation_size = POSITIONS + VELOCITIES
    snapshot_size = PHYSICS_SIZE + POSITIONS + VELOCITIES
    actions = ActionSpace(size=JOINTS, discrete=False)

    @cached_property
    def skills(self) -> tuple[Skill, ...]:
        one_hot = np.eye(len(SKILLS)).tolist()
        return tuple(Skill(name, tuple(row)) for name, row in zip(SKILLS, one_hot, strict=True))

    @cached_property
    def factors(self) -> Factors:
        """The joints' positions; all else is an object's, whether a skill is about it or not."""
        objects = {}
        placed = {name: positions for name, (positions, _) in GOALS.items()} | IDLE
        for name, positions in placed.items():
            # Velocities are numbered alike, but that the kettle has one fewer, and is the last.
            velocities = range(positions.start, min(positions.stop, VELOCITIES))
            moving = range(POSITIONS + velocities.start, POSITIONS + velocities.stop)
            objects[name] = Object(
                _columns(range(positions.start, positions.stop)), _columns(moving)
            )
        return Factors(tuple(range(JOINTS)), objects, own={name: name for name in SKILLS})

    @cached_property
    def blur(self) -> np.ndarray:
        """Largest noise of each number seen, (59,), in its own unit."""
        table = _robot_table()
        position, velocity = table["pos_noise_amp"][:, 0], table["vel_noise_amp"][:, 0]
        # Objects take their positions' amplitudes from one joint too early, as in the original.
        robot = self.robot_noise_ratio * np.r_[position[:9], velocity[:9]]
        objects = self.object_noise_ratio * np.r_[position[8:29], velocity[9:29]]
        return np.r_[robot, objects]

    def vector_env(self) -> KitchenVectorEnv:
        return KitchenVectorEnv(self)


def goal_distances(positions: np.ndarray, skill: int) -> np.ndarray:
    """How far from the skill's goal, L2: positions (n, 30) -> (n,) float64."""
    where, goal = GOALS[SKILLS[skill]]
    # Row by row, as in the original: a sum over an axis rounds differently.
    return np.array([np.linalg.norm(gap) for gap in positions[:, where] - np.array(goal)])


@cache
def kitchen_model() -> mujoco.MjModel:
    """The compiled model, one a process; for reading, and for MjData of one's own."""
    model = mujoco.MjModel.from_xml_path(str(_assets() / "kitchen_assets/kitchen_env_model.xml"))
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)
    # Else MuJoCo writes a MUJOCO_LOG.TXT into whatever directory the worker stands in.
    mujoco.set_mju_user_warning(logging.getLogger(__name__).warning)
    return model


def _assets() -> Path:
    package = find_spec("gymnasium_robotics")  # found, not imported: that takes long and prints
    assert package is not None
    assert package.origin is not None
    return Path(package.origin).parent / "envs/assets/kitchen_franka"


@cache
def _robot_table() -> dict[str, np.ndarray]:
    """Bounds and noise amplitudes by joint, each (joints, 1 or 2)."""
    joints = ElementTree.parse(_assets() / "franka_assets/franka_config.xml").getroot()
    columns = ("pos_bound", "pos_noise_amp", "vel_noise_amp")
    return {
        column: np.array([joint.attrib[column].split() for joint in joints], dtype=np.float64)
        for column in columns
    }


class KitchenVectorEnv:
    """N kitchens, with one `MjData` each, kept and reused from one use to the next.

    An action asks the robot's joints for velocities, in units of ±2 rad/s (fingers ±2 m/s); they
    become position targets counted from the positions *last seen*, noise included. So what was seen
    is part of the state: noise is drawn once, when a step ends, and a snapshot holds the
    observation beside the physics. A restored episode therefore sees what it saw when the snapshot
    was taken, draws nothing, and takes its first noise from the new stream at its next step; with
    the old stream it goes on as if it had never stopped.

    Physics that diverge (numbers not finite or beyond 1e10, where MuJoCo would reset the state)
    end their episode and no other: `diverged` (N,) says so, the episode keeps its last sound
    observation, no step moves it, no goal holds in it, and its snapshot is NaN and not accepted
    back.
    """

    def __init__(self, kitchen: Kitchen) -> None:
        self.kitchen = kitchen
        self.diverged = np.zeros(0, dtype=bool)
        self._pool: list[mujoco.MjData] = []
        self._streams: list[np.random.Generator] = []
        self._states = np.zeros((0, POSITIONS + VELOCITIES))  # as they are
        self._seen = np.zeros((0, POSITIONS + VELOCITIES))  # as observed: reordered, with noise

    def reset(self, streams: Sequence[np.random.Generator]) -> None:
        start = np.r_[START, np.zeros(2 * VELOCITIES)]  # at rest, and a cold start for the solver
        self._begin(np.tile(start, (len(streams), 1)), streams)
        self._seen = np.zeros_like(self._states)
        self._look(np.arange(len(streams)))

    def restore(self, snapshots: np.ndarray, streams: Sequence[np.random.Generator]) -> None:
        if not np.isfinite(snapshots).all():
            raise ValueError("a kitchen snapshot is not finite: its episode had diverged")
        self._begin(snapshots[:, :PHYSICS_SIZE], streams)
        self._seen = snapshots[:, PHYSICS_SIZE:].copy()

    def _begin(self, physics: np.ndarray, streams: Sequence[np.random.Generator]) -> None:
        model = kitchen_model()
        self._pool += [mujoco.MjData(model) for _ in range(len(streams) - len(self._pool))]
        for state, data in zip(physics, self._pool[: len(streams)], strict=True):
            mujoco.mj_resetData(model, data)  # clears its warnings
            mujoco.mj_setState(model, data, state, PHYSICS)
        self.diverged = np.zeros(len(streams), dtype=bool)
        self._streams = list(streams)
        self._states = physics[:, : POSITIONS + VELOCITIES].copy()

    def snapshot(self, rows: np.ndarray) -> np.ndarray:
        snapshots = np.full((len(rows), self.kitchen.snapshot_size), np.nan)
        for row, snapshot in zip(rows.tolist(), snapshots, strict=True):
            if not self.diverged[row]:
                physics = snapshot[:PHYSICS_SIZE]
                mujoco.mj_getState(kitchen_model(), self._pool[row], physics, PHYSICS)
                snapshot[PHYSICS_SIZE:] = self._seen[row]
        return snapshots

    def observe(self, rows: np.ndarray) -> np.ndarray:
        return self._seen[rows].astype(np.float32)

    def positions(self, rows: np.ndarray) -> np.ndarray:
        """Generalised positions as they are, without noise: (n, 30)."""
        return self._states[rows, :POSITIONS]

    def achieved(self, rows: np.ndarray, skill: int) -> np.ndarray:
        near = goal_distances(self.positions(rows), skill) < GOAL_RADIUS
        return near & ~self.diverged[rows]

    def step(self, rows: np.ndarray, actions: np.ndarray) -> None:
        if not np.isfinite(actions).all():
            raise ValueError("a kitchen action is not finite: what proposed it is broken")
        alive = ~self.diverged[rows]
        rows, targets = rows[alive], self._targets(rows[alive], actions[alive])
        states = np.empty((len(rows), POSITIONS + VELOCITIES))
        warnings = np.empty((len(rows), int(mujoco.mjtWarning.mjNWARNING)), dtype=np.int64)
        model = kitchen_model()
        for index, row in enumerate(rows.tolist()):
            data = self._pool[row]
            data.ctrl[:] = targets[index]
            mujoco.mj_step(model, data, nstep=SUBSTEPS)
            states[index, :POSITIONS] = data.qpos
            states[index, POSITIONS:] = data.qvel
            warnings[index] = data.warning.number
        bounded = (np.abs(states) <= mujoco.mjMAXVAL).all(axis=1)  # False for NaN
        sound = bounded & ~warnings[:, RESETTING].any(axis=1)
        self.diverged[rows[~sound]] = True
        self._states[rows[sound]] = states[sound]
        self._look(rows[sound])

    def _targets(self, rows: np.ndarray, actions: np.ndarray) -> np.ndarray:
        """Joint positions to be held during a step, (n, 9): from the last seen, within bounds."""
        low, high = _robot_table()["pos_bound"][:JOINTS].T
        velocities = TOP_SPEED * np.clip(actions.astype(np.float64), -1, 1)
        return np.clip(self._seen[rows, :JOINTS] + velocities * STEP_SECONDS, low, high)

    def _look(self, rows: np.ndarray) -> None:
        """Draw these episodes' noise of the moment."""
        draws = np.empty((len(rows), POSITIONS + VELOCITIES))
        for row, own in zip(rows.tolist(), draws, strict=True):
            self._streams[row].random(out=own)
        self._seen[rows] = self._states[rows][:, SEEN] + self.kitchen.blur * (2 * draws - 1)


KITCHEN = Kitchen()

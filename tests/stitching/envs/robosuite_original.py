"""robosuite's own environment, made to play our actions: the rule of an action told once more."""

from __future__ import annotations

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from stitching.envs.robosuite.can import Can
from stitching.envs.robosuite.door import Door
from stitching.envs.robosuite.models import original
from stitching.envs.robosuite.vector_env import AHEAD, CONTROL_STEPS, NEAR, STRIDE, TURN

TASKS = {"robosuite-door": "Door", "robosuite-can": "PickPlaceCan"}


class Original:
    """One episode of `env.step`, ten control steps a second."""

    def __init__(self, benchmark: Door | Can) -> None:
        self.env = original(TASKS[benchmark.name])
        self._workspace = benchmark.workspace
        self._pointing = Rotation.from_matrix(benchmark.pointing)
        self._model = self.env.sim.model._model
        self._scratch = mujoco.MjData(self._model)
        self._grip = self._model.site("gripper0_right_grip_site").id
        arm, model = range(9), self._model
        joints = {"robosuite-door": ("Door_hinge", "Door_latch_joint"), "robosuite-can": ()}
        joint = [model.joint(name) for name in joints[benchmark.name]] or [
            model.joint("Can_joint0")
        ]
        self._positions = np.r_[arm, *[np.arange(len(j.qpos0)) + j.qposadr[0] for j in joint]]
        width = 1 if benchmark.name == "robosuite-door" else 6
        self._velocities = np.r_[arm, *[np.arange(width) + j.dofadr[0] for j in joint]]

        self.positions = len(self._positions)
        self.size = self.positions + 2 * len(self._velocities)  # of a state

    @property
    def data(self) -> mujoco.MjData:
        return self.env.sim.data._data

    def reset(self, rng: np.random.Generator) -> None:
        self.env.rng, samplers = rng, [self.env.placement_initializer]
        while samplers:  # each holds a generator of its own
            sampler = samplers.pop()
            sampler.rng = rng
            samplers += getattr(sampler, "samplers", {}).values()
        self.env.reset()

    def state(self) -> np.ndarray:
        """Positions, velocities and warm start of what our model has too."""
        data = self.data
        of_velocities = data.qvel[self._velocities], data.qacc_warmstart[self._velocities]
        return np.concatenate((data.qpos[self._positions], *of_velocities))

    def command(self) -> float:
        """The fingers', -1 to 1."""
        return float(self.env.robots[0].gripper["right"].current_action[-1])

    def posture(self) -> np.ndarray:
        """(7,) rad, what the controller's redundant joint is drawn to."""
        return self.env.robots[0].part_controllers["right"].initial_joint

    def go_to(self, state: np.ndarray, command: float) -> None:
        """A state as `state` gives it, and the fingers' command."""
        positions, velocities = len(self._positions), len(self._velocities)
        qpos, qvel, warm = np.split(state, [positions, positions + velocities])
        self.data.qpos[self._positions] = qpos
        self.data.qvel[self._velocities] = qvel
        self.data.qacc_warmstart[self._velocities] = warm
        self.env.robots[0].gripper["right"].current_action = np.array([-command, command])

    def step(self, action: np.ndarray) -> None:
        """Plays an action (5,)."""
        low, high = self._workspace
        action = np.clip(action.astype(np.float64), -1, 1)
        there = low + (high - low) * (action[:3] + 1) / 2
        rotation = self._pointing * Rotation.from_euler("z", TURN * action[3])
        for _ in range(CONTROL_STEPS):
            self._scratch.qpos[:] = self.data.qpos
            mujoco.mj_kinematics(self._model, self._scratch)
            here = self._scratch.site_xpos[self._grip]
            way = there - here
            way *= min(1, STRIDE / np.linalg.norm(way))
            self.env.step(np.r_[here + way, rotation.as_rotvec(), 1 if action[4] > 0 else -1])
            turned = Rotation.from_matrix(self.data.site_xmat[self._grip].reshape(3, 3))
            left = np.linalg.norm(there - self.data.site_xpos[self._grip])
            ahead = (rotation * turned.inv()).magnitude()
            if left < NEAR and ahead < AHEAD and abs(self.command()) == 1:
                break

    def observation(self) -> np.ndarray:
        """(25,) by its own observables, of the state as it is now."""
        self.env.sim.forward()
        self.env._get_observations(force_update=True)  # relative poses are of the update before
        seen = self.env._get_observations(force_update=True)
        names = ("eef_pos", "eef_quat", "gripper_qpos", "gripper_qvel")
        return np.concatenate([*[seen[f"robot0_{name}"] for name in names], seen["object-state"]])

    def success(self) -> bool:
        return bool(self.env._check_success())


# Ways to do the tasks, action by action: where to be (m) from where the handle or the can lies at
# the start, turned with the door; the can's from its lift on in the world; the turn, as an action
# has it; the fingers.
def _door_path() -> list[tuple[float, ...]]:
    angles = np.array([0.4, 0.8, 1.2, 1.4])
    turning = np.c_[0.12 - 0.12 * np.cos(angles), 0 * angles, -0.12 * np.sin(angles)]
    turned = [(*at, angle / (np.pi / 2), 1.0) for at, angle in zip(turning, angles, strict=True)]
    pulled = [(0.1 - 0.015 * k, 0.04 * k, -0.12, 0.89, 1.0) for k in range(1, 6)]
    before = [(0.0, 0.1, 0.0, 0.0, -1.0)] * 3 + [(0.0, 0.0, 0.0, 0.0, -1.0)]
    return [*before, *[(0.0, 0.0, 0.0, 0.0, 1.0)] * 2, *turned, *pulled]


DOOR_PATH = np.array(_door_path())
CAN_PATH = np.array(
    [
        *[(0, 0, 0.1, 0, -1)] * 2,
        (0, 0, 0.0, 0, -1),
        *[(0, 0, 0.0, 0.1, 1)] * 2,
        (0, 0, 0.2, 0.1, 1),
        *[(0.2, 0.4, 1.05, 0.2, 1)] * 4,
        *[(0.2, 0.4, 1.05, 0.2, -1)] * 2,
    ],
    dtype=np.float64,
)


def path_actions(benchmark: Door | Can, observation: np.ndarray) -> np.ndarray:
    """Actions (steps, 5) float32 that do the task from a start observation (25,)."""
    door = benchmark.name == "robosuite-door"
    path = (DOOR_PATH if door else CAN_PATH).copy()
    if door:
        across = observation[14:16] - observation[11:13]  # from the door's middle to its handle
        turn = np.arctan2(across[1], across[0]) - np.arctan2(0.1, 0.05)
        path[:, :3] = Rotation.from_euler("z", turn).apply(path[:, :3]) + observation[14:17]
    else:
        path[:6, :3] += observation[18:21]
    low, high = benchmark.workspace
    path[:, :3] = 2 * (path[:, :3] - low) / (high - low) - 1
    return path.astype(np.float32)

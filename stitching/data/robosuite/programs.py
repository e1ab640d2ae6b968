"""One waypoint program a skill: poses to send the gripper to, one after the other."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from stitching.envs.robosuite.can import CAN_POSITION
from stitching.envs.robosuite.door import DOOR_POSITION, HANDLE_POSITION, HANDLE_TURN
from stitching.envs.robosuite.vector_env import GRIP_POSITION, TURN

OPEN, CLOSED = -1.0, 1.0  # the fingers

LEVER = 0.12  # m, from the handle's axis to where it is held
# From the door's middle, where the door is not turned: m to the right (x), out of the door (y), up.
AXIS = np.array([0.175, 0.1, -0.025])
REST = AXIS - [0.125, 0, 0]  # the handle's end, the handle not turned


@dataclass(frozen=True)
class Waypoint:
    """A pose to be at; the gripper is sent there until it is, or until patience ends."""

    at: tuple[float, float, float]  # m, in the object's frame; it is followed where it goes
    fingers: float
    turn: float = 0.0  # rad
    near: float = 0.02  # m
    patience: int = 3  # actions
    least: int = 1  # actions, even if it is there at once: fingers need two to close
    world: bool = False  # `at` is a place in the world
    loose: float = 1.0  # how freely a demonstrator would vary it, against its jitter
    holding: float = np.inf  # m, from the gripper to the object; if it is farther, it was missed


W = Waypoint

# A demonstrator takes hold once it is about where it means to (m), and begins again when the can or
# the handle's end is not with the gripper (m): what it shows has to follow from what it sees, or
# nobody could learn it.
BETWEEN, HELD = 0.025, 0.05


def _door(pull: float, turns: tuple[float, ...]) -> tuple[Waypoint, ...]:
    """Take the handle's end between the fingers, turn it so far (rad, down is positive), then pull.

    The pull (m, out of the door) goes on until the door is open or closed.
    """
    held = [
        (LEVER - LEVER * float(np.cos(turn)), 0.0, -LEVER * float(np.sin(turn))) for turn in turns
    ]
    turning = [
        W(at, CLOSED, turn, patience=1, holding=HELD) for at, turn in zip(held, turns, strict=True)
    ]
    x, _, z = held[-1]
    return (
        W((0.0, 0.2, 0.03), OPEN, near=0.05, patience=4),  # the hand swings round to face the door
        W((0.0, 0.1, 0.0), OPEN, near=0.03, patience=4),
        W((0.0, 0.0, 0.0), OPEN, near=BETWEEN, patience=8, loose=0.4),
        W((0.0, 0.0, 0.0), CLOSED, least=2, loose=0.4),
        *turning,
        W((x, pull, z), CLOSED, turns[-1], near=0.0, patience=6, loose=0.4, holding=HELD),
    )


PROGRAMS: dict[str, tuple[Waypoint, ...]] = {
    "open door": _door(0.06, turns=(0.4, 0.8, 1.2, 1.4)),
    # Closing lifts the handle: one turned down, as opening leaves it, is in hardly any of its data.
    "close door": _door(-0.06, turns=(-0.4, -0.8, -1.2, -1.55)),
    "can": (
        W((0.0, 0.0, 0.1), OPEN, near=0.03, patience=8),
        W((0.0, 0.0, 0.0), OPEN, near=BETWEEN, patience=8, loose=0.4),
        W((0.0, 0.0, 0.0), CLOSED, least=2, loose=0.4),
        W((0.0, 0.0, 0.12), CLOSED, near=0.0, patience=1, holding=HELD),
        W((0.2, 0.4, 1.02), CLOSED, near=0.06, patience=8, world=True, holding=HELD),
        W((0.2, 0.4, 1.0), OPEN, least=2, world=True, near=0.05),
    ),
}

# Where to back off to after a miss, in the object's frame.
BACK_OFF = {"open door": (0.0, 0.14, 0.0), "close door": (0.0, 0.14, 0.0), "can": (0.0, 0.0, 0.15)}


@dataclass(frozen=True)
class Style:
    """How a demonstrator varies from attempt to attempt and from action to action."""

    jitter: float  # m, standard deviation of a waypoint
    noise: float  # of an action's numbers but the fingers', standard deviation
    slip: float  # probability that an action is a random one


def style(quality: float) -> Style:
    """From a steady expert, 1, to a beginner who misses most of the time, 0."""
    clumsy = 1 - quality
    return Style(
        jitter=0.004 + 0.026 * clumsy,
        noise=0.01 + 0.07 * clumsy,
        slip=0.12 * clumsy,
    )


def object_frame(skill: str, observation: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Where a skill's object is, (3,) m, and how it stands, (3, 3); a handle as if unturned."""
    seen = observation.astype(np.float64)
    if skill == "can":
        return seen[CAN_POSITION], np.eye(3)
    door = seen[DOOR_POSITION]
    across = seen[HANDLE_POSITION] - door
    out = np.array([AXIS[0] + (REST - AXIS)[0] * np.cos(seen[HANDLE_TURN]), AXIS[1]])
    angle = np.arctan2(across[1], across[0]) - np.arctan2(out[1], out[0])
    cos, sin = np.cos(angle), np.sin(angle)
    turned = np.array([[cos, -sin, 0], [sin, cos, 0], [0, 0, 1]])
    return door + turned @ REST, turned


class ScriptedDemonstrator:
    """Goes through a skill's program, sees where it got, and begins again after a miss."""

    def __init__(
        self, skill: str, workspace: np.ndarray, style: Style, rng: np.random.Generator
    ) -> None:
        self._skill, self._style, self._rng = skill, style, rng
        self._workspace = workspace
        self._todo: list[tuple[Waypoint, np.ndarray]] = []  # and its jitter, (3,) m
        self._tried = 0  # actions towards the first of them
        self._missed = False

    def act(self, observation: np.ndarray) -> np.ndarray:
        """The next action (5,) float32 for an observation (25,)."""
        if self._todo and self._lost(observation):
            self._todo = []
        while self._todo and self._passed(observation):
            self._todo.pop(0)
            self._tried = 0
        if not self._todo:
            self._begin()
        self._tried += 1
        if self._rng.random() < self._style.slip:
            return self._rng.uniform(-1, 1, 5).astype(np.float32)
        low, high = self._workspace
        pose = 2 * (self._place(observation) - low) / (high - low) - 1
        waypoint = self._todo[0][0]
        pose = np.r_[pose, waypoint.turn / TURN]
        pose += self._style.noise * self._rng.standard_normal(4)
        return np.clip(np.r_[pose, waypoint.fingers], -1, 1).astype(np.float32)

    def _place(self, observation: np.ndarray) -> np.ndarray:
        """Where the first waypoint is now, (3,) m."""
        waypoint, jitter = self._todo[0]
        if waypoint.world:
            return waypoint.at + jitter
        origin, turned = object_frame(self._skill, observation)
        return origin + turned @ (waypoint.at + jitter)

    def _passed(self, observation: np.ndarray) -> bool:
        waypoint = self._todo[0][0]
        gap = np.linalg.norm(self._place(observation) - observation[GRIP_POSITION])
        enough = self._tried >= waypoint.least
        return enough and bool(gap < waypoint.near or self._tried >= waypoint.patience)

    def _lost(self, observation: np.ndarray) -> bool:
        held = CAN_POSITION if self._skill == "can" else HANDLE_POSITION
        gap = np.linalg.norm(observation[held] - observation[GRIP_POSITION])
        return bool(gap > self._todo[0][0].holding)

    def _begin(self) -> None:
        waypoints = PROGRAMS[self._skill]
        if self._missed:
            waypoints = (Waypoint(BACK_OFF[self._skill], OPEN, near=0.04, least=2), *waypoints)
        self._missed, self._tried = True, 0
        for waypoint in waypoints:
            jitter = self._style.jitter * waypoint.loose * self._rng.standard_normal(3)
            self._todo.append((waypoint, jitter))

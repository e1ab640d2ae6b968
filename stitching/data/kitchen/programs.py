"""One waypoint program a skill, and how a demonstrator carries it out.

The numbers were read off the paths of people's hands where there are any (microwave, kettle, light
switch, slide cabinet; Minari `D4RL/kitchen/complete-v2`) and off the model's geometry elsewhere.
`rates.py` measures what they are worth.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from stitching.data.kitchen.arm import GRIP_CLOSED, GRIP_OPEN, HOME, Arm, hand_turn


@dataclass(frozen=True)
class Waypoint:
    """A pose of the hand to pass, and how far the fingers shall be open on the way there."""

    offset: tuple[float, float, float]  # m, from the object's site: right, away, up
    turn: tuple[float, float, float] = (0.0, 0.0, 0.0)  # rad: yaw left, pitch up, roll
    grip: float = GRIP_OPEN  # m, each finger
    speed: float = 0.04  # m a step
    near: float = 0.02  # m, from where on it counts as passed
    patience: int = 8  # steps beyond those that the way to it asks for
    loose: float = 1.0  # how freely a human would vary it, against the style's jitter


@dataclass(frozen=True)
class Program:
    """How one skill is done: waypoints about a site of the scene, and how it leaves."""

    site: str
    waypoints: tuple[Waypoint, ...]
    leave: tuple[float, float, float] = (
        0.0,
        0.0,
        -0.12,
    )  # m, on leaving: in the hand's frame, up, right, forward


CLOSED = GRIP_CLOSED
W = Waypoint
# fmt: off
KNOB = (  # taken between the fingers and turned with the wrist
    W((0.0, -0.14, 0.0), (0.0, 0.3, 0.0), speed=0.09),
    W((0.0, -0.02, 0.0), (0.0, 0.3, 0.0), near=0.01, loose=0.3),
    W((0.0, -0.02, 0.0), (0.0, 0.3, 0.0), grip=CLOSED, near=0.0, patience=4, loose=0.3),
    W((0.0, -0.02, 0.0), (0.0, 0.3, 0.9), grip=CLOSED, near=0.0, patience=15, loose=0.3),
)
PROGRAMS: dict[str, Program] = {
    "bottom burner": Program("knob2_site", KNOB),
    "top burner": Program("knob4_site", KNOB),
    "light switch": Program("light_site", (
        W((0.03, -0.15, 0.0), (0.0, 0.3, 0.0), speed=0.09),
        W((0.01, -0.03, 0.01), (0.0, 0.3, 0.0), near=0.01, loose=0.3),
        W((-0.14, -0.03, 0.0), (0.0, 0.3, 0.0), speed=0.08, patience=20, loose=0.3),
    )),
    "slide cabinet": Program("slide_site", (
        W((0.03, -0.2, -0.2), (0.0, 0.4, 0.0), speed=0.09, near=0.04),
        W((0.0, -0.1, -0.08), (0.0, 0.4, 0.0), speed=0.08, near=0.03, loose=0.5),
        W((0.0, -0.02, -0.06), (0.0, 0.4, 0.0), near=0.01, loose=0.3),
        W((0.25, 0.0, -0.06), (-0.2, 0.4, 0.0), speed=0.08, loose=0.3),
    )),
    "hinge cabinet": Program("hinge_site2", (
        W((0.0, -0.13, -0.03), speed=0.09, patience=25),
        W((0.0, -0.01, -0.03), near=0.01, speed=0.05, loose=0.3),
        W((0.0, -0.01, -0.03), grip=CLOSED, near=0.0, patience=5, loose=0.3),
        W((0.07, -0.13, -0.03), grip=CLOSED, speed=0.05, near=0.03, loose=0.3),
        W((0.18, -0.21, -0.03), grip=CLOSED, speed=0.05, near=0.03, loose=0.3),
        W((0.31, -0.24, -0.03), grip=CLOSED, speed=0.05, near=0.03, loose=0.3),
        W((0.42, -0.22, -0.03), grip=CLOSED, speed=0.06, near=0.0, patience=15, loose=0.3),
    )),
    "microwave": Program("microhandle_site", (
        W((0.03, -0.15, 0.08), speed=0.09),
        W((0.0, 0.0, 0.08), (0.2, 0.0, 0.0), near=0.01, speed=0.05, loose=0.3),
        W((0.0, 0.0, 0.08), (0.2, 0.0, 0.0), grip=CLOSED, near=0.0, patience=5, loose=0.3),
        W((-0.03, -0.16, 0.07), (0.3, 0.0, 0.0), grip=CLOSED, speed=0.05, loose=0.3),
        W((-0.11, -0.37, 0.07), (0.6, 0.0, 0.0), grip=CLOSED, speed=0.05, loose=0.3),
    )),
    "kettle": Program("kettle_site", (
        W((-0.12, -0.13, -0.06), (-0.3, 0.0, 0.0), speed=0.09),
        W((-0.09, 0.0, -0.09), (-0.3, 0.0, 0.0), near=0.01, speed=0.05, loose=0.3),
        W((-0.09, 0.0, -0.09), (-0.3, 0.0, 0.0), grip=CLOSED, near=0.0, patience=5, loose=0.3),
        W((-0.06, 0.1, -0.02), (-0.3, 0.0, 0.0), grip=CLOSED, loose=0.3),
        W((-0.03, 0.3, 0.0), (-0.3, 0.0, 0.0), grip=CLOSED, speed=0.05, loose=0.3),
    ), leave=(-0.06, 0.0, -0.12)),  # below the handle, or the kettle hangs on the finger
}
# fmt: on

# On leaving a skill for the next.
OPENING, LEAVING, HOMING = 4, 8, 30  # steps at most for each part of it
LEAVE_SPEED = 0.09  # m a step
CLEAR = 0.03  # m from where the hand wanted to go: far enough away
# On taking the arm elsewhere: where the hand may be then, in the world.
FREE = np.array([[-0.65, 0.25, 1.8], [0.0, 0.5, 2.5]])  # m, lower and upper corner
FREE_TURN = 0.3  # rad, at most, of yaw, pitch and roll
RELOCATING = 40  # steps at most
HOMED = 0.3  # rad of every joint from the start posture: close enough to set out from


@dataclass(frozen=True)
class Style:
    """How a demonstrator varies from attempt to attempt and from step to step."""

    jitter: float  # m, standard deviation of a loose waypoint
    slowest: float  # least factor on the programs' speeds; the greatest is 1.1
    pause: float  # probability of a pause at a waypoint in the air
    noise: float  # standard deviation of the action's noise


def style(quality: float) -> Style:
    """From a steady expert, 1, to one who shakes and misses, 0."""
    sloppy = 1 - quality
    return Style(
        jitter=0.005 + 0.0225 * sloppy,
        slowest=0.8 - 0.2 * sloppy,
        pause=0.02 + 0.2 * sloppy,
        noise=0.02 + 0.14 * sloppy,
    )


def perform(
    program: Program,
    arm: Arm,
    style: Style,
    rng: np.random.Generator,
    *,
    last: Program | None,
    return_home: bool,
) -> Iterator[np.ndarray]:
    """Clean actions (9,), each for what `arm` has just seen; over and over until the skill holds.

    Where another skill was before, or this one missed, the hand leaves that first and, if it
    shall, goes back to the start posture.
    """
    while True:
        pace = rng.uniform(style.slowest, 1.1)
        if last:
            yield from _leave(arm, last, pace)
            if return_home:
                yield from _return_home(arm)
        last, origin = program, arm.site(program.site)
        for waypoint in program.waypoints:
            jitter = style.jitter * waypoint.loose * rng.standard_normal(3)
            yield from _pass(arm, origin + waypoint.offset + jitter, waypoint, pace)
            if waypoint.loose == 1 and rng.random() < style.pause:  # in the air, not in touch
                for _ in range(rng.integers(1, 6)):
                    yield arm.bend(np.zeros_like(HOME), waypoint.grip)


def _pass(arm: Arm, position: np.ndarray, waypoint: Waypoint, pace: float) -> Iterator[np.ndarray]:
    speed = pace * waypoint.speed
    steps = waypoint.patience + int(1.5 * np.linalg.norm(position - arm.position) / speed)
    for _ in range(steps):
        if np.linalg.norm(position - arm.position) < waypoint.near:
            break
        yield arm.reach(position, hand_turn(*waypoint.turn), speed, waypoint.grip)


def _leave(arm: Arm, program: Program, pace: float) -> Iterator[np.ndarray]:
    for _ in range(OPENING):
        yield arm.bend(np.zeros_like(HOME), GRIP_OPEN)
    turn = arm.turn
    there = arm.position + turn.apply(program.leave)
    for _ in range(LEAVING):
        if np.linalg.norm(there - arm.position) < CLEAR:
            break
        yield arm.reach(there, turn, pace * LEAVE_SPEED, GRIP_OPEN)


def relocate(arm: Arm, last: Program, rng: np.random.Generator) -> Iterator[np.ndarray]:
    """Clean actions (9,) that leave a skill for a random free pose in front of the objects."""
    yield from _leave(arm, last, 1.0)
    place = rng.uniform(FREE[0], FREE[1])
    turn = hand_turn(*rng.uniform(-FREE_TURN, FREE_TURN, 3))
    for _ in range(RELOCATING):
        if np.linalg.norm(place - arm.position) < CLEAR:
            break
        yield arm.reach(place, turn, LEAVE_SPEED, GRIP_OPEN)


def _return_home(arm: Arm) -> Iterator[np.ndarray]:
    for _ in range(HOMING):
        if np.abs(HOME - arm.joints).max() < HOMED:
            break
        yield arm.bend(HOME - arm.joints, GRIP_OPEN)

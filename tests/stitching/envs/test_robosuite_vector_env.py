"""Blocks of robosuite episodes: exact snapshots, the next can, divergence, what an action is."""

import copy
from dataclasses import dataclass
from functools import cache

import mujoco
import numpy as np
import pytest

from stitching.envs.robosuite.can import BIN, CAN, HALF_SIZE, PLACE, Can, can_pose, placed
from stitching.envs.robosuite.door import CLOSED, DOOR, OPEN, WIDEST, Door
from stitching.envs.robosuite.vector_env import (
    CONTROL_STEPS,
    FINGER_POSITIONS,
    GRIP_POSITION,
    HAND_QUATERNION,
    OBJECTS,
    SUBSTEPS,
    RobosuiteVectorEnv,
    poses,
)
from stitching.streams import stream
from tests.stitching.envs.robosuite_original import path_actions

EPISODES = 3
ROWS = np.arange(EPISODES)
BOUNDARIES = {"robosuite-door": 8, "robosuite-can": 5}  # the handle, the can in hand
GOING_ON = 3  # actions
HINGE, COMMAND = 9, {"robosuite-door": 33, "robosuite-can": 46}  # in a snapshot

both = pytest.mark.parametrize("benchmark", [DOOR, CAN], ids=lambda benchmark: benchmark.name)


@dataclass(frozen=True)
class Ride:
    """Three episodes that do their task."""

    actions: np.ndarray  # (steps, 3, 5) float32
    snapshots: np.ndarray  # (steps + 1, 3, snapshot)
    observations: np.ndarray  # (steps + 1, 3, 25)


@cache
def ride(benchmark: Door | Can) -> Ride:
    env = benchmark.vector_env()
    env.reset(streams("ride"))
    seen = [env.observe(ROWS)]
    actions = np.stack([path_actions(benchmark, start) for start in seen[0]], axis=1)
    snapshots = [env.snapshot(ROWS)]
    for action in actions:
        env.step(ROWS, action)
        seen.append(env.observe(ROWS))
        snapshots.append(env.snapshot(ROWS))
    assert env.achieved(ROWS, 0).all()
    return Ride(actions, np.array(snapshots), np.array(seen))


def streams(use: str = "") -> list[np.random.Generator]:
    return [stream("robosuite", use, row) for row in ROWS.tolist()]


def restored(benchmark: Door | Can, snapshots: np.ndarray) -> RobosuiteVectorEnv:
    env = benchmark.vector_env()
    env.restore(snapshots, streams()[: len(snapshots)])
    return env


@both
def test_snapshots_continue_exactly_amid_contacts(benchmark: Door | Can) -> None:
    """In whatever order and company: each door stands elsewhere, and all share a model."""
    went, at = ride(benchmark), BOUNDARIES[benchmark.name]
    order = [2, 0]
    env = restored(benchmark, went.snapshots[at][order])
    for step in range(at, at + GOING_ON):
        env.step(ROWS[:2], went.actions[step][order])
        assert env.snapshot(ROWS[:2]).tobytes() == went.snapshots[step + 1][order].tobytes()
        assert env.observe(ROWS[:2]).tobytes() == went.observations[step + 1][order].tobytes()


def parts(benchmark: Door | Can) -> dict[str, slice]:
    model, command = benchmark.arm.mujoco, COMMAND[benchmark.name]
    velocities = model.nq + model.nv
    return {
        "positions": slice(0, model.nq),
        "velocities": slice(model.nq, velocities),
        "warm start": slice(velocities, command),
        "fingers' command": slice(command, command + 1),
        "posture": slice(command + 1, command + 8),
        "where the door stands": slice(command + 8, benchmark.snapshot_size),
    }


@both
def test_no_part_of_a_snapshot_can_be_left_out(benchmark: Door | Can) -> None:
    went, at = ride(benchmark), BOUNDARIES[benchmark.name]
    whole = restored(benchmark, went.snapshots[at])
    whole.step(ROWS, went.actions[at])
    for name, part in parts(benchmark).items():
        snapshots = went.snapshots[at].copy()
        if not snapshots[:, part].size:
            continue
        snapshots[:, part] = went.snapshots[0][:, part] if name != "posture" else 0
        if name == "where the door stands":
            snapshots[:, part] = np.roll(snapshots[:, part], 1, axis=0)
        env = restored(benchmark, snapshots)
        env.step(ROWS, went.actions[at])
        assert (env.positions(ROWS) != whole.positions(ROWS)).any(axis=1).all(), name


@both
def test_the_parts_are_the_whole(benchmark: Door | Can) -> None:
    numbers = np.arange(benchmark.snapshot_size)
    covered = np.concatenate([numbers[part] for part in parts(benchmark).values()])
    np.testing.assert_array_equal(covered, numbers)


def test_a_placed_can_is_followed_by_another() -> None:
    went = ride(CAN)
    env, draws = CAN.vector_env(), streams("second")
    env.restore(went.snapshots[-1], draws)
    assert not env.achieved(ROWS, 0).any()
    before, after = went.observations[-1], env.observe(ROWS)
    np.testing.assert_array_equal(before[:, : OBJECTS.start], after[:, : OBJECTS.start])
    for row, rng in enumerate(streams("second")):
        np.testing.assert_array_equal(env.positions(ROWS)[row, 9:], can_pose(rng))
        assert rng.random() == draws[row].random()  # all of it from the episode's stream
    again = path_actions(CAN, after[0])
    for action in [*again[:1].repeat(3, axis=0), *again]:  # it is farther than from home
        env.step(ROWS[:1], action[None])
    assert env.achieved(ROWS[:1], 0).all()


@pytest.mark.parametrize("at", [0, BOUNDARIES["robosuite-can"]])
def test_a_can_not_in_its_place_stays(at: int) -> None:
    draws = streams("second")
    env = CAN.vector_env()
    env.restore(ride(CAN).snapshots[at], draws)
    assert env.snapshot(ROWS).tobytes() == ride(CAN).snapshots[at].tobytes()
    fresh = [rng.random() for rng in streams("second")]
    assert [rng.random() for rng in draws] == fresh


def test_cans_start_in_the_first_bin() -> None:
    rng = stream("cans")
    starts = np.array([can_pose(rng) for _ in range(300)])
    inside = np.abs(starts[:, :2] - BIN[:2]) <= np.array(HALF_SIZE) - 0.025
    assert inside.all()
    assert (np.ptp(starts[:, :2], axis=0) > 1.8 * (np.array(HALF_SIZE) - 0.025)).all()
    assert not placed(starts[:, :3], starts[:, :3] + 1).any()


def test_a_can_counts_once_it_is_let_go_of() -> None:
    middle = PLACE.mean(axis=0)
    cans = middle + np.array([[0, 0, 0], [0, 0, 0], [0.2, 0, 0], [0, 0, 0.06]])
    grips = cans + np.array([[0, 0, 0.05], [0, 0, 0.04], [0, 0, 0.05], [0, 0, 0.05]])
    assert placed(cans, grips).tolist() == [True, False, False, False]


@pytest.mark.parametrize(
    ("hinge", "opened", "closed"),
    [(0.0, False, True), (0.04, False, True), (0.06, False, False), (0.31, True, False)],
)
def test_door_angles(hinge: float, opened: bool, closed: bool) -> None:
    snapshots = ride(DOOR).snapshots[0].copy()
    snapshots[:, HINGE] = hinge
    env = restored(DOOR, snapshots)
    assert env.achieved(ROWS, 0).tolist() == [opened] * EPISODES
    assert env.achieved(ROWS, 1).tolist() == [closed] * EPISODES


def test_a_door_merely_pushed_to_stops_at_its_latch() -> None:
    model = DOOR.arm.mujoco
    env = restored(DOOR, ride(DOOR).snapshots[0])
    data = env._pool[0].data
    DOOR.place(ride(DOOR).snapshots[0, 0, -7:])
    data.qpos[HINGE], data.qfrc_applied[HINGE] = OPEN, -3
    mujoco.mj_step(model, data, nstep=500)
    assert 3 * CLOSED < data.qpos[HINGE] < 0.19


def test_a_door_may_start_open() -> None:
    shut, wide = DOOR.vector_env(), Door(starts_open=True).vector_env()
    shut.reset(streams())
    wide.reset(streams())
    hinges = wide.positions(ROWS)[:, HINGE]
    assert (hinges >= OPEN).all()
    assert (hinges <= WIDEST).all()
    assert len(set(hinges)) == EPISODES
    assert not wide.achieved(ROWS, 1).any()
    np.testing.assert_array_equal(wide.snapshot(ROWS)[:, -7:], shut.snapshot(ROWS)[:, -7:])


@both
def test_an_action_ends_on_arrival_or_after_its_steps(benchmark: Door | Can) -> None:
    env = benchmark.vector_env()
    env.reset(streams())
    action = np.zeros((EPISODES, 5), dtype=np.float32)
    action[:, 4] = -1
    times = []
    for _ in range(8):
        env.step(ROWS, action)
        times.append([env._pool[row].data.time for row in ROWS])
    steps = np.diff(times, axis=0, prepend=0) / (0.002 * SUBSTEPS)
    np.testing.assert_allclose(steps[0], CONTROL_STEPS)
    np.testing.assert_allclose(steps[-1], 1)
    gap = env.observe(ROWS)[:, :3] - benchmark.workspace.mean(axis=0)
    assert np.linalg.norm(gap, axis=1).max() < 0.01


@both
def test_the_pose_is_what_actions_bring_back_and_the_hand_s_tilt_is_not(
    benchmark: Door | Can,
) -> None:
    env = benchmark.vector_env()
    env.reset(streams())
    begun = env.observe(ROWS)
    action = np.zeros((EPISODES, 5), dtype=np.float32)
    low, high = benchmark.workspace
    home = 2 * (begun[:, GRIP_POSITION] - low) / (high - low) - 1
    for there in (action[:, :3], home):
        action[:, :3] = there
        for _ in range(4):
            env.step(ROWS, action)
    gaps = np.abs(env.observe(ROWS) - begun).max(axis=0)
    assert gaps[GRIP_POSITION].max() < 0.01  # m
    assert gaps[HAND_QUATERNION].max() > 0.04
    pose = np.array(benchmark.factors.pose)
    np.testing.assert_array_equal(pose, np.r_[GRIP_POSITION, FINGER_POSITIONS])


@both
def test_actions_are_clipped_to_the_workspace(benchmark: Door | Can) -> None:
    far = np.array([[-9, 9, -9, 9, 9], [-1, 1, -1, 1, 1]], dtype=np.float32)
    positions, rotations, closing = poses(benchmark, far)
    np.testing.assert_array_equal(positions[0], positions[1])
    np.testing.assert_array_equal(rotations[0], rotations[1])
    assert closing.tolist() == [1, 1]
    np.testing.assert_allclose(positions[0], benchmark.workspace[[0, 1, 0], [0, 1, 2]])


@both
def test_broken_actions_are_refused(benchmark: Door | Can) -> None:
    env = restored(benchmark, ride(benchmark).snapshots[0])
    with pytest.raises(ValueError, match="not finite"):
        env.step(ROWS, np.full((EPISODES, 5), np.nan, dtype=np.float32))


@both
@pytest.mark.parametrize("speed", [1e9, 1e160])
@pytest.mark.parametrize("joint", [0, -1])
def test_divergence_ends_one_episode_and_no_other(
    benchmark: Door | Can, speed: float, joint: int
) -> None:
    went, at = ride(benchmark), BOUNDARIES[benchmark.name]
    model = benchmark.arm.mujoco
    snapshots = went.snapshots[at].copy()
    snapshots[1, model.nq : model.nq + model.nv][joint] = speed
    env = restored(benchmark, snapshots)
    seen = env.observe(ROWS)
    for step in range(at, at + 2):
        env.step(ROWS, went.actions[step])
    assert env.diverged.tolist() == [False, True, False]
    others = ROWS[[0, 2]]
    assert env.snapshot(others).tobytes() == went.snapshots[at + 2][others].tobytes()
    np.testing.assert_array_equal(env.observe(ROWS)[1], seen[1])
    assert not any(env.achieved(ROWS, skill)[1] for skill in range(len(benchmark.skills)))
    assert np.isnan(env.snapshot(ROWS)[1]).all()
    with pytest.raises(ValueError, match="diverged"):
        env.restore(env.snapshot(ROWS), streams())
    env.restore(went.snapshots[at], copy.deepcopy(streams()))
    assert not env.diverged.any()


@both
def test_blocks_share_one_model(benchmark: Door | Can) -> None:
    assert benchmark.arm is type(benchmark)().arm
    assert benchmark.arm.mujoco.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_AUTORESET

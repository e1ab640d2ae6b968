"""FrankaKitchen: bit for bit the original, through contacts; exact snapshots; divergence flagged.

The original plays each episode alone; ours play together, as rows of one block. Generators of both
are made alike, so all that is compared is compared as bytes.
"""

import copy
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import mujoco
import numpy as np
import pytest
from gymnasium_robotics.envs.franka_kitchen.kitchen_env import (
    OBS_ELEMENT_GOALS,
    OBS_ELEMENT_INDICES,
    KitchenEnv,
)

from stitching.envs.factors import Object
from stitching.envs.kitchen import (
    GOAL_RADIUS,
    GOALS,
    JOINTS,
    KITCHEN,
    PHYSICS_SIZE,
    SEEN,
    SKILLS,
    Kitchen,
    KitchenVectorEnv,
    goal_distances,
    kitchen_model,
)
from stitching.envs.protocol import conditions
from stitching.streams import stream

# What is pushed about for each skill.
SITES = {
    "bottom burner": "knob2_site",
    "top burner": "knob4_site",
    "light switch": "light_site",
    "slide cabinet": "slide_site",
    "hinge cabinet": "hinge_site2",
    "microwave": "microhandle_site",
    "kettle": "kettle_site",
}
STEPS = 200
BOUNDARIES = (45, 82, 160)  # amid contacts
ROWS = np.arange(len(SKILLS))
SEEN_AT = slice(PHYSICS_SIZE, None)

# Parts of a snapshot.
PARTS = {
    "positions": slice(0, 30),
    "velocities": slice(30, 59),
    "warm start": slice(59, 88),
    "robot positions seen": slice(88, 97),
    "all else seen": slice(97, 147),
}

HUMAN = Path(__file__).parents[4] / "shared/data/kitchen_complete_v2_minari.npz"
HUMAN_SKILLS = [SKILLS.index(s) for s in ("microwave", "kettle", "light switch", "slide cabinet")]
human = pytest.mark.skipif(not HUMAN.exists(), reason=f"no human demonstrations at {HUMAN}")


@cache
def scratch() -> mujoco.MjData:
    return mujoco.MjData(kitchen_model())


def at(positions: np.ndarray) -> mujoco.MjData:
    """Where all bodies are, and what touches, at these positions (30,)."""
    scratch().qpos[:] = positions
    mujoco.mj_fwdPosition(kitchen_model(), scratch())
    return scratch()


def restless_hand(positions: np.ndarray, skill: str, step: int) -> np.ndarray:
    """An action (9,) that drives the hand around, and so against, a skill's object."""
    model, data, jacobian = kitchen_model(), at(positions), np.zeros((3, 29))
    hand, target = model.site("end_effector").id, model.site(SITES[skill]).id
    wander = 0.1 * np.sin(step * np.array([0.13, 0.17, 0.23]))
    gap = data.site_xpos[target] + wander - data.site_xpos[hand]
    mujoco.mj_jacSite(model, data, jacobian, None, hand)
    J = jacobian[:, :7]
    arm = J.T @ np.linalg.solve(J @ J.T + 0.01 * np.eye(3), gap) / 0.16
    fingers = np.full(2, np.sin(0.1 * step))
    tremor = 0.1 * stream("tremor", skill, step).standard_normal(9)
    return (np.r_[arm, fingers] + tremor).astype(np.float32)  # often beyond ±1


@dataclass(frozen=True)
class Ride:
    """Seven episodes in one block, the hand of each at another skill's object."""

    actions: np.ndarray  # (STEPS, 7, 9) float32
    snapshots: np.ndarray  # (STEPS + 1, 7, 147)
    achieved: np.ndarray  # (STEPS + 1, 7, skills)
    contacts: np.ndarray  # (STEPS + 1, 7) how many, of the robot with things
    streams: dict[int, list[np.random.Generator]]  # as they were at each boundary


def noise(use: str = "ride") -> list[np.random.Generator]:
    return [stream("kitchen", use, skill) for skill in SKILLS]


def achievements(env: KitchenVectorEnv, rows: np.ndarray) -> np.ndarray:
    return np.stack([env.achieved(rows, skill) for skill in range(len(SKILLS))], axis=1)


def touches(positions: np.ndarray) -> int:
    """Contacts between a body of the robot's and one that is not."""
    model, data = kitchen_model(), at(positions)
    robot = model.body_rootid[model.jnt_bodyid[0]]
    roots = model.body_rootid[model.geom_bodyid[data.contact.geom]]  # (contacts, 2)
    return int(((roots == robot).sum(axis=1) == 1).sum())


@pytest.fixture(scope="module")
def ride() -> Ride:
    env, streams = KITCHEN.vector_env(), noise()
    env.reset(streams)
    actions, snapshots, kept = [], [env.snapshot(ROWS)], {}
    achieved = [achievements(env, ROWS)]
    contacts = [[touches(row) for row in env.positions(ROWS)]]
    for step in range(STEPS):
        if step in BOUNDARIES:
            kept[step] = copy.deepcopy(streams)
        hands = zip(env.positions(ROWS), SKILLS, strict=True)
        actions.append(np.stack([restless_hand(row, skill, step) for row, skill in hands]))
        env.step(ROWS, actions[-1])
        snapshots.append(env.snapshot(ROWS))
        achieved.append(achievements(env, ROWS))
        contacts.append([touches(row) for row in env.positions(ROWS)])
    assert not env.diverged.any()
    return Ride(
        np.array(actions), np.array(snapshots), np.array(achieved), np.array(contacts), kept
    )


@pytest.fixture(scope="module")
def original() -> Iterator[KitchenEnv]:
    env = KitchenEnv(terminate_on_tasks_completed=False, remove_task_when_completed=False)
    yield env
    env.close()


def played_by(
    original: KitchenEnv, rng: np.random.Generator, actions: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Its snapshots (steps + 1, 147) and achievements (steps + 1, skills), in our layout."""
    original.robot_env.np_random = rng
    scenes, achieved = [], []
    for action in [None, *actions]:
        seen = original.reset()[0] if action is None else original.step(action)[0]
        data = original.data
        state = (data.qpos, data.qvel, data.qacc_warmstart, seen["observation"])
        scenes.append(np.concatenate(state))
        original.compute_reward(seen["achieved_goal"], seen["desired_goal"], {})
        achieved.append([skill in original.step_task_completions for skill in SKILLS])
    return np.array(scenes), np.array(achieved)


@pytest.mark.parametrize("skill", SKILLS)
def test_equals_the_original_through_contacts(ride: Ride, original: KitchenEnv, skill: str) -> None:
    row = SKILLS.index(skill)
    rng = noise()[row]
    scenes, achieved = played_by(original, rng, ride.actions[:, row])
    for step in range(STEPS + 1):
        assert ride.snapshots[step, row].tobytes() == scenes[step].tobytes(), f"step {step}"
    np.testing.assert_array_equal(ride.achieved[:, row], achieved)


def test_noise_is_drawn_as_often_as_by_the_original(ride: Ride, original: KitchenEnv) -> None:
    ours, theirs = copy.deepcopy(ride.streams[BOUNDARIES[0]][0]), noise()[0]
    played_by(original, theirs, ride.actions[: BOUNDARIES[0], 0])
    assert ours.random() == theirs.random()


def test_the_ride_is_worth_comparing(ride: Ride) -> None:
    """In every episode the hand is at its object for long, and moves it."""
    assert (ride.actions > 1).any()
    assert (ride.actions < -1).any()
    for row, skill in enumerate(SKILLS):
        assert (ride.contacts[:, row] > 0).mean() > 0.4, skill
        moved = np.ptp(ride.snapshots[:, row, GOALS[skill][0]], axis=0)
        assert moved.max() > 0.1, skill
    assert ride.achieved.any(axis=(0, 1)).sum() >= 4
    for boundary in BOUNDARIES:
        assert (ride.contacts[boundary] > 0).sum() >= 6, boundary


@pytest.mark.parametrize("boundary", BOUNDARIES)
def test_snapshots_continue_exactly_amid_contacts(ride: Ride, boundary: int) -> None:
    env = KITCHEN.vector_env()
    env.restore(ride.snapshots[boundary], copy.deepcopy(ride.streams[boundary]))
    for step in range(boundary, boundary + 40):
        assert env.snapshot(ROWS).tobytes() == ride.snapshots[step].tobytes(), f"step {step}"
        env.step(ROWS, ride.actions[step])


@pytest.mark.parametrize("part", PARTS)
def test_no_part_of_a_snapshot_can_be_left_out(ride: Ride, part: str) -> None:
    boundary = BOUNDARIES[1]
    touching = np.flatnonzero(ride.contacts[boundary])
    noticed = []
    for left_out in (False, True):
        snapshots = ride.snapshots[boundary].copy()
        if left_out:
            snapshots[:, PARTS[part]] = ride.snapshots[0][:, PARTS[part]]  # the start's instead
        env = KITCHEN.vector_env()
        env.restore(snapshots, copy.deepcopy(ride.streams[boundary]))
        seen = env.observe(touching)
        env.step(ROWS, ride.actions[boundary])
        noticed.append(np.c_[seen, env.snapshot(touching)])
    assert (noticed[0] != noticed[1]).any(axis=1).all()


def test_the_parts_are_the_whole() -> None:
    covered = np.concatenate([np.arange(KITCHEN.snapshot_size)[part] for part in PARTS.values()])
    np.testing.assert_array_equal(covered, np.arange(KITCHEN.snapshot_size))


def test_a_fresh_stream_blurs_from_the_next_step_on(ride: Ride) -> None:
    """The boundary is seen as it was seen before, whoever goes on from it."""
    boundary = BOUNDARIES[0]
    scenes = []
    for use in ("one", "another"):
        env, streams = KITCHEN.vector_env(), noise(use)
        env.restore(ride.snapshots[boundary], streams)
        assert [a.random() for a in streams] == [b.random() for b in noise(use)]  # none was drawn
        before = env.observe(ROWS)
        env.step(ROWS, ride.actions[boundary])
        scenes.append((before, env.positions(ROWS), env.observe(ROWS)))
    before, after, seen_after = (np.stack(pair) for pair in zip(*scenes, strict=True))
    assert before[0].tobytes() == before[1].tobytes()
    assert before[0].tobytes() == ride.snapshots[boundary][:, SEEN_AT].astype(np.float32).tobytes()
    assert after[0].tobytes() == after[1].tobytes()
    assert (seen_after[0] != seen_after[1]).any(axis=1).all()


def test_what_was_seen_steers() -> None:
    """Position targets are counted from the noisy positions, so noise moves the arm."""
    sharp = Kitchen(robot_noise_ratio=0).vector_env()
    blurred = Kitchen(robot_noise_ratio=0.5).vector_env()
    for env in (sharp, blurred):
        env.reset(noise()[:1])
        env.step(ROWS[:1], np.zeros((1, 9), dtype=np.float32))
    gap = np.abs(sharp.positions(ROWS[:1]) - blurred.positions(ROWS[:1]))
    assert gap[0, :7].max() > 1e-3
    assert gap[0, 9:23].max() < 1e-9


def test_without_noise_the_state_itself_is_seen(ride: Ride) -> None:
    env = Kitchen(robot_noise_ratio=0, object_noise_ratio=0).vector_env()
    env.restore(ride.snapshots[BOUNDARIES[0]], noise())
    env.step(ROWS, ride.actions[0])
    state = env.snapshot(ROWS)[:, :59]
    np.testing.assert_array_equal(env.observe(ROWS), state[:, SEEN].astype(np.float32))


def test_skills_and_goals_are_the_originals() -> None:
    assert [skill.name for skill in KITCHEN.skills] == list(OBS_ELEMENT_GOALS)
    np.testing.assert_array_equal(conditions(KITCHEN), np.eye(7))
    for skill, (where, goal) in GOALS.items():
        np.testing.assert_array_equal(np.arange(30)[where], OBS_ELEMENT_INDICES[skill])
        np.testing.assert_array_equal(goal, OBS_ELEMENT_GOALS[skill])


@pytest.mark.parametrize("skill", SKILLS)
def test_goals_hold_exactly_where_the_originals_do(original: KitchenEnv, skill: str) -> None:
    rng = stream("around the goal", skill)
    where, goal = GOALS[skill]
    direction = rng.standard_normal((2000, len(goal)))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    spread = np.r_[np.full(1000, 1e-16), np.full(1000, 0.1)] * rng.standard_normal(2000)
    positions = np.zeros((2000, 30))
    positions[:, where] = goal + (GOAL_RADIUS + spread[:, None]) * direction
    holds = goal_distances(positions, SKILLS.index(skill)) < GOAL_RADIUS

    elsewhere = {name: OBS_ELEMENT_GOALS[name] + 9 for name in SKILLS}
    theirs = []
    for row in positions[:, where]:
        original.compute_reward({**elsewhere, skill: row}, OBS_ELEMENT_GOALS, {})
        theirs.append(original.step_task_completions == [skill])
    np.testing.assert_array_equal(holds, theirs)
    assert 0 < holds[:1000].sum() < 1000
    assert 0 < holds[1000:].sum() < 1000


def test_a_goal_does_not_hold_at_its_very_edge(ride: Ride) -> None:
    snapshots, slide = ride.snapshots[0][:2].copy(), SKILLS.index("slide cabinet")
    where, (goal,) = GOALS["slide cabinet"]
    edge = 0.07
    assert goal - edge == GOAL_RADIUS  # to the last bit
    snapshots[:, where] = [[edge], [edge + 1e-15]]
    env = KITCHEN.vector_env()
    env.restore(snapshots, noise()[:2])
    assert env.achieved(ROWS[:2], slide).tolist() == [False, True]


def test_goals_are_judged_without_noise_and_without_memory(ride: Ride) -> None:
    snapshots = ride.snapshots[0].copy()
    where, goal = GOALS["microwave"]
    snapshots[0, where], snapshots[1, SEEN_AT] = goal, 0
    snapshots[1, PHYSICS_SIZE + 18 - 9 + where.start] = goal[0]  # merely seen there
    env, microwave = KITCHEN.vector_env(), SKILLS.index("microwave")
    env.restore(snapshots, noise())
    assert env.achieved(ROWS, microwave).tolist() == [True] + [False] * 6
    env.restore(ride.snapshots[0], noise())
    assert not env.achieved(ROWS, microwave).any()


def test_blocks_share_one_model() -> None:
    assert kitchen_model() is kitchen_model()
    assert kitchen_model().opt.disableflags & mujoco.mjtDisableBit.mjDSBL_AUTORESET


def diverging(ride: Ride, joint: int, speed: float) -> np.ndarray:
    """Snapshots of which row 1 stands at the microwave's goal, with an absurd velocity."""
    snapshots = ride.snapshots[0].copy()
    where, goal = GOALS["microwave"]
    snapshots[1, where] = goal
    snapshots[1, 30 + joint] = speed
    return snapshots


@pytest.mark.parametrize(
    ("joint", "speed"),
    [
        pytest.param(0, 1e9, id="leaves numbers that are not finite"),
        pytest.param(12, 1e8, id="would have been reset on the way, and ends finite"),
    ],
)
def test_an_episode_that_diverges_ends_alone(
    ride: Ride,
    joint: int,
    speed: float,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    caplog: pytest.LogCaptureFixture,
) -> None:
    monkeypatch.chdir(tmp_path)
    others, dead, microwave = np.array([0, 2, 3, 4, 5, 6]), np.array([1]), SKILLS.index("microwave")
    broken, sound = KITCHEN.vector_env(), KITCHEN.vector_env()
    broken.restore(diverging(ride, joint, speed), noise())
    sound.restore(ride.snapshots[0], noise())
    last_seen = broken.observe(dead)
    assert broken.achieved(dead, microwave).all()

    for actions in ride.actions[:3]:
        broken.step(ROWS, actions)
        sound.step(ROWS, actions)
    assert broken.diverged.tolist() == [False, True] + [False] * 5
    assert not sound.diverged.any()
    assert broken.snapshot(others).tobytes() == sound.snapshot(others).tobytes()
    assert broken.observe(dead).tobytes() == last_seen.tobytes()
    assert not achievements(broken, dead).any()
    assert np.isfinite(broken.positions(dead)).all()
    assert "unstable" in caplog.text
    assert not list(tmp_path.iterdir())  # no MUJOCO_LOG.TXT

    assert np.isnan(broken.snapshot(dead)).all()
    with pytest.raises(ValueError, match="diverged"):
        broken.restore(broken.snapshot(ROWS), noise())
    broken.restore(ride.snapshots[0], noise())
    for actions in ride.actions[:3]:
        broken.step(ROWS, actions)
    assert not broken.diverged.any()
    assert broken.snapshot(ROWS).tobytes() == sound.snapshot(ROWS).tobytes()


@pytest.mark.parametrize("bad", [np.nan, -1e11])
def test_numbers_gone_bad_in_the_last_substep_are_noticed(
    bad: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of which MuJoCo would warn in the next step only."""
    env, real_step = KITCHEN.vector_env(), mujoco.mj_step
    env.reset(noise())
    last_seen = env.observe(ROWS)
    stepped = []

    def step(model: mujoco.MjModel, data: mujoco.MjData, nstep: int) -> None:
        real_step(model, data, nstep=nstep)
        stepped.append(env._pool.index(data))
        if stepped[-1] == 2:
            data.qvel[28] = bad

    monkeypatch.setattr(mujoco, "mj_step", step)
    for _ in range(2):
        env.step(ROWS, np.zeros((7, 9), dtype=np.float32))
    assert stepped == [0, 1, 2, 3, 4, 5, 6, 0, 1, 3, 4, 5, 6]  # it would cost seconds a step
    assert np.flatnonzero(env.diverged).tolist() == [2]
    np.testing.assert_array_equal((env.observe(ROWS) == last_seen).all(axis=1), env.diverged)


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_a_broken_action_is_refused(bad: float) -> None:
    env = KITCHEN.vector_env()
    env.reset(noise())
    before = env.snapshot(ROWS)
    actions = np.zeros((7, 9), dtype=np.float32)
    actions[3, 4] = bad
    with pytest.raises(ValueError, match="action is not finite"):
        env.step(ROWS, actions)
    assert env.snapshot(ROWS).tobytes() == before.tobytes()


@dataclass(frozen=True)
class Episodes:
    """Human demonstrations; episode e has rows first[e] : first[e] + length[e]."""

    observations: np.ndarray
    actions: np.ndarray
    first: np.ndarray
    length: np.ndarray

    def some(self, number: int) -> "Episodes":
        return replace(self, first=self.first[:number], length=self.length[:number])

    def streams(self) -> list[np.random.Generator]:
        """Each was recorded after a reset with the seed 123, as its first observation tells."""
        return [np.random.Generator(np.random.PCG64(123)) for _ in self.length]


@pytest.fixture(scope="module")
def episodes() -> Episodes:
    with np.load(HUMAN) as stored:
        first = np.r_[0, stored["episode_ends"][:-1]]
        length = stored["episode_ends"] - first
        return Episodes(stored["observations"], stored["actions"], first, length)


@human
def test_human_episodes_are_seen_as_recorded_until_something_is_touched(
    episodes: Episodes,
) -> None:
    """The kettle aside: recorded with another MuJoCo, it settles 1 mm lower there."""
    env, rows = KITCHEN.vector_env(), np.arange(len(episodes.length))
    env.reset(episodes.streams())
    all_but_kettle = np.r_[0:32, 39:53]
    for step in range(20):
        gap = env.observe(rows) - episodes.observations[episodes.first + step]
        assert np.abs(gap[:, all_but_kettle]).max() < 1e-6, f"step {step}"
        env.step(rows, episodes.actions[episodes.first + step])


@human
def test_human_episodes_achieve_their_tasks_when_they_did(episodes: Episodes) -> None:
    episodes = episodes.some(6)  # for the sake of time; all 14 do
    env = KITCHEN.vector_env()
    env.reset(episodes.streams())
    ours = np.full((len(episodes.length), len(HUMAN_SKILLS)), -1)
    recorded = ours.copy()
    for step in range(episodes.length.max()):
        rows = np.flatnonzero(step < episodes.length)
        at = episodes.first[rows] + step
        # Positions as recorded: robot's, then objects'.
        seen = episodes.observations[at].astype(np.float64)[:, np.r_[0:9, 18:39]]
        for column, skill in enumerate(HUMAN_SKILLS):
            near = goal_distances(seen, skill) < GOAL_RADIUS
            for times, holds in ((ours, env.achieved(rows, skill)), (recorded, near)):
                first_time = rows[holds & (times[rows, column] < 0)]
                times[first_time, column] = step
        env.step(rows, episodes.actions[at])
    assert (recorded > 0).all()
    assert (ours > 0).all()
    assert np.abs(ours - recorded).max() <= 2


@human
def test_a_human_episode_equals_the_originals(episodes: Episodes, original: KitchenEnv) -> None:
    actions = episodes.actions[: episodes.length[0]]
    scenes, achieved = played_by(original, episodes.streams()[0], actions)
    env, row = KITCHEN.vector_env(), ROWS[:1]
    env.reset(episodes.streams()[:1])
    for step, action in enumerate([None, *actions]):
        if action is not None:
            env.step(row, action[None])
        assert env.snapshot(row)[0].tobytes() == scenes[step].tobytes(), f"step {step}"
        np.testing.assert_array_equal(achievements(env, row)[0], achieved[step])
    assert achieved[:, HUMAN_SKILLS].any(axis=0).all()


@pytest.mark.parametrize("skill", SKILLS)
def test_an_objects_columns_are_its_joints_positions_and_velocities(skill: str) -> None:
    model = kitchen_model()
    seen = {number: column for column, number in enumerate(SEEN.tolist())}
    positions, velocities = [], []
    for joint in range(model.njnt):
        position, velocity = int(model.jnt_qposadr[joint]), int(model.jnt_dofadr[joint])
        if position in OBS_ELEMENT_INDICES[skill]:
            free = model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_FREE
            positions += [seen[position + i] for i in range(7 if free else 1)]
            velocities += [seen[model.nq + velocity + i] for i in range(6 if free else 1)]
    assert KITCHEN.factors.objects[skill] == Object(tuple(positions), tuple(velocities))


def test_all_that_is_not_the_robot_s_is_an_object_s() -> None:
    owned = [column for one in KITCHEN.factors.objects.values() for column in one.columns]
    assert sorted(owned) == list(range(2 * JOINTS, KITCHEN.observation_size))


@pytest.mark.parametrize("skill", SKILLS)
def test_other_objects_are_all_but_the_skill_s_own(skill: str) -> None:
    others = KITCHEN.factors.others_than(skill)
    own = KITCHEN.factors.objects[skill].columns
    assert sorted([*others, *own]) == list(range(2 * JOINTS, KITCHEN.observation_size))

"""Algorithm 1: the tree against playing from the start, the stop rule, limits, and streams.

The first half plays briefly trained models; the second, walkers with hand-made weights, signposts
for stitchers and an open floor, where each step can be told beforehand.
"""

import os
import pickle
import subprocess
import sys
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field, fields, replace
from itertools import pairwise, permutations
from typing import ClassVar

import numpy as np
import pytest
from torch import Tensor

from stitching.envs.first_times import FirstTimes
from stitching.envs.maze import Maze, MazeVectorEnv
from stitching.envs.protocol import ActionSpace, VectorEnv, conditions
from stitching.methods.no_stitch import NoStitch
from stitching.methods.protocol import Models, Proposal, Stitcher
from stitching.methods.random_stitch import RandomStitch, RandomStitchSettings
from stitching.models.agent import Agent
from stitching.rollout import (
    Block,
    RolloutConfig,
    Segments,
    begin,
    play_from_start,
    play_segment,
    policy_noise,
)
from tests.stitching.methods.linear import ARM, MOVES, streams

SAMPLED, MODE = RolloutConfig(temperature=1.0), RolloutConfig()
FIRST = replace(SAMPLED, first_stitch=True)
STEP_LIMIT = 40
METHODS = [
    "no-stitch", "random-stitch", "mf-stitch", "mb-stitch", "mb-stitch[execute=1]", "reach-stitch",
]  # fmt: skip
TASKS = [("a", "b", "c"), ("d", "b", "a"), ("b", "d", "c", "a"), ("c", "a", "d", "b")]

each_method = pytest.mark.parametrize("method", METHODS)
each_reading = pytest.mark.parametrize("config", [SAMPLED, FIRST], ids=["between", "first"])


def block_of(method: str, prefix: Sequence[str], episodes: Sequence[int] = range(6)) -> Block:
    return Block(0, "maze", 0, method, tuple(episodes), tuple(prefix))


def raw(segments: Segments) -> dict[str, tuple[str, tuple[int, ...], bytes]]:
    """Every column with its type and shape, byte for byte."""
    columns = {f.name: getattr(segments, f.name) for f in fields(Segments)}
    return {name: (c.dtype.str, c.shape, c.tobytes()) for name, c in columns.items()}


@dataclass
class Log:
    """Each step of a segment: phase, rows, and snapshots after it."""

    steps: list[tuple[str, list[int], np.ndarray]] = field(default_factory=list)

    def step(
        self, env: VectorEnv, rows: np.ndarray, episodes: np.ndarray, skill: int, phase: str
    ) -> None:
        self.steps.append((phase, rows.tolist(), env.snapshot(rows)))

    def count(self, phase: str, row: int) -> int:
        return sum(row in rows for name, rows, _ in self.steps if name == phase)

    def path(self, row: int) -> list[tuple[int, ...]]:
        return [
            tuple(int(x) for x in snapshots[rows.index(row)])
            for _, rows, snapshots in self.steps
            if row in rows
        ]


class Tree:
    """The rollout tree of a block of episodes: every node once, from its parent's snapshots.

    All nodes share one block, as on a worker; snapshots travel as bytes.
    """

    def __init__(
        self, maze: Maze, agent: Agent, stitchers: dict[str, Stitcher], config: RolloutConfig
    ) -> None:
        self.maze, self.agent, self.stitchers, self.config = maze, agent, stitchers, config
        self.env: VectorEnv = maze.vector_env()
        self.nodes: dict[tuple[str, tuple[str, ...]], tuple[Block, Segments, np.ndarray]] = {}

    def node(self, block: Block, step_limit: int) -> tuple[Block, Segments, np.ndarray]:
        """What was played at the node, the outcome, and steps used by each episode since start."""
        first = len(block.prefix) == 1
        stitched = self.config.first_stitch and self.stitchers[block.method].before_first
        # First skills that are not stitched to: one node for all methods.
        here = replace(block, method="") if first and not stitched else block
        key = here.method, here.prefix
        if key in self.nodes:
            return self.nodes[key]
        used, snapshots = np.zeros(len(block.episodes), dtype=np.int64), None
        if not first:
            parent, outcome, end_step = self.node(
                replace(block, prefix=block.prefix[:-1]), step_limit
            )
            survived = outcome.success
            here = replace(here, episodes=tuple(np.array(parent.episodes)[survived].tolist()))
            used = end_step[survived]
            stored = np.ascontiguousarray(outcome.snapshots[survived])
            snapshots = np.frombuffer(stored.tobytes()).reshape(stored.shape)
        begin(self.env, here, snapshots)
        stitcher = self.stitchers[block.method] if here.method else NoStitch()
        segments = play_segment(
            self.env, self.agent, stitcher, self.maze, self.config, here, step_limit - used
        )
        self.nodes[key] = here, segments, used + segments.steps
        return self.nodes[key]

    def task(self, block: Block, step_limit: int) -> list[Segments]:
        """The task read off the tree, as far as anyone got."""
        outcome: list[Segments] = []
        for depth in range(1, len(block.prefix) + 1):
            if outcome and not outcome[-1].success.any():
                break
            node = self.node(replace(block, prefix=block.prefix[:depth]), step_limit)
            outcome.append(node[1])
        return outcome


@each_method
@each_reading
@pytest.mark.parametrize("episodes", [range(1), range(5, 8), range(16)], ids=len)
def test_the_tree_gives_the_bytes_of_playing_each_task_alone(
    maze: Maze,
    agent: Agent,
    stitchers: dict[str, Stitcher],
    method: str,
    config: RolloutConfig,
    episodes: range,
) -> None:
    tree = Tree(maze, agent, stitchers, config)
    for task in TASKS:
        block = block_of(method, task, episodes)
        alone = play_from_start(
            maze.vector_env(), agent, stitchers[method], maze, config, block, STEP_LIMIT
        )
        from_tree = tree.task(block, STEP_LIMIT)
        assert [raw(s) for s in alone] == [raw(s) for s in from_tree]


def test_a_policy_told_of_no_skill_is_played_alike(
    maze: Maze, unconditioned: Agent, stitchers: dict[str, Stitcher]
) -> None:
    """Its snapshots say what has held, and its goals are reached in more orders than asked."""
    skills = len(maze.skills)
    tree = Tree(maze, unconditioned, stitchers, SAMPLED)
    tree.env = FirstTimes(maze.vector_env(), skills)
    ahead = 0
    for task in TASKS:
        block = block_of("no-stitch", task, range(16))
        env = FirstTimes(maze.vector_env(), skills)
        alone = play_from_start(env, unconditioned, NoStitch(), maze, SAMPLED, block, STEP_LIMIT)
        assert [raw(s) for s in alone] == [raw(s) for s in tree.task(block, STEP_LIMIT)]
        assert len(alone) > 1
        held = alone[0].snapshots[alone[0].success][:, -skills:]
        ahead += int((held.sum(axis=1) > 1).sum())
    assert ahead


@each_method
def test_a_whole_tree_gives_the_bytes_of_every_task(
    maze: Maze, agent: Agent, stitchers: dict[str, Stitcher], method: str
) -> None:
    """All orders of three skills; the nodes are visited in an order no single task would take."""
    tree = Tree(maze, agent, stitchers, SAMPLED)
    names = [skill.name for skill in maze.skills]
    for length in (2, 1, 3):
        for prefix in permutations(reversed(names), length):
            tree.task(block_of(method, prefix), STEP_LIMIT)
    reached: Counter[tuple[int, bool]] = Counter()
    for task in permutations(names, 3):
        block = block_of(method, task)
        alone = play_from_start(
            maze.vector_env(), agent, stitchers[method], maze, SAMPLED, block, STEP_LIMIT
        )
        assert [raw(s) for s in alone] == [raw(s) for s in tree.task(block, STEP_LIMIT)]
        reached[len(alone), bool(alone[-1].success.all())] += 1
    assert len(reached) > 1  # tasks ended differently: there was something to confuse


@each_method
def test_a_first_skill_is_stitched_to_where_the_method_can(
    maze: Maze, agent: Agent, stitchers: dict[str, Stitcher], method: str
) -> None:
    def first(config: RolloutConfig) -> Segments:
        block = block_of(method, TASKS[0][:1], range(12))
        (segments,) = play_from_start(
            maze.vector_env(), agent, stitchers[method], maze, config, block, STEP_LIMIT
        )
        return segments

    without, with_first = first(SAMPLED), first(FIRST)
    assert not without.stitch_steps.any()
    there = method == "reach-stitch"  # these skills begin at the start cell: it is there already
    assert with_first.stitch_steps.any() == (stitchers[method].before_first and not there)
    if not stitchers[method].before_first:
        assert raw(without) == raw(with_first)


@each_method
def test_shorter_limits_can_be_read_off_the_longest(
    maze: Maze, agent: Agent, stitchers: dict[str, Stitcher], method: str
) -> None:
    block = block_of(method, TASKS[2], range(12))
    decided = set()

    def end_steps(step_limit: int) -> dict[tuple[int, int], int]:
        """(depth, episode) → the step at which that skill was accomplished."""
        played = play_from_start(
            maze.vector_env(), agent, stitchers[method], maze, SAMPLED, block, step_limit
        )
        episodes, used = np.array(block.episodes), np.zeros(12, dtype=np.int64)
        found: dict[tuple[int, int], int] = {}
        for depth, segments in enumerate(played):
            used = (used + segments.steps)[segments.success]
            episodes = episodes[segments.success]
            found |= {(depth, int(e)): int(u) for e, u in zip(episodes, used, strict=True)}
        return found

    longest = end_steps(60)
    for step_limit in (5, 12, 20, 30):
        shorter = end_steps(step_limit)
        assert shorter == {key: step for key, step in longest.items() if step <= step_limit}
        decided.add(len(shorter))
    assert len(decided) > 2


@each_method
def test_an_episode_does_not_depend_on_its_company(
    maze: Maze, agent: Agent, stitchers: dict[str, Stitcher], method: str
) -> None:
    """To the rounding of batched products: bytes are promised for equal blocks alone."""
    block = block_of(method, TASKS[0], [7, 3, 11])
    together = play_from_start(
        maze.vector_env(), agent, stitchers[method], maze, SAMPLED, block, STEP_LIMIT
    )
    for row, episode in enumerate(block.episodes):
        (first, *_) = play_from_start(
            maze.vector_env(), agent, stitchers[method], maze, SAMPLED,
            replace(block, episodes=(episode,)), STEP_LIMIT,
        )  # fmt: skip
        for name in ("success", "stitch_steps", "steps", "snapshots"):
            assert np.array_equal(getattr(first, name)[0], getattr(together[0], name)[row]), name
        np.testing.assert_allclose(first.value_end[0], together[0].value_end[row], atol=1e-5)


IN_ANOTHER_PROCESS = """
import pickle, sys
import torch
from stitching.rollout import play_from_start
torch.set_num_threads(1)
maze, agent, stitchers, config, blocks, step_limit = pickle.load(sys.stdin.buffer)
outcomes = [
    play_from_start(
        maze.vector_env(), agent, stitchers[block.method], maze, config, block, step_limit
    )
    for block in blocks
]
pickle.dump(outcomes, sys.stdout.buffer)
"""


def test_another_process_gives_the_same_bytes(
    maze: Maze, agent: Agent, stitchers: dict[str, Stitcher]
) -> None:
    blocks = [block_of(method, task) for method in METHODS for task in TASKS[:3]]
    here = [
        play_from_start(
            maze.vector_env(), agent, stitchers[block.method], maze, SAMPLED, block, STEP_LIMIT
        )
        for block in blocks
    ]
    blocks_backwards = blocks[::-1]  # the order in which a worker gets its work is nobody's promise
    worker = subprocess.run(
        [sys.executable, "-c", IN_ANOTHER_PROCESS],
        input=pickle.dumps((maze, agent, stitchers, SAMPLED, blocks_backwards, STEP_LIMIT)),
        env={**os.environ, "PYTHONHASHSEED": "7"},
        capture_output=True,
        check=True,
    )
    there = pickle.loads(worker.stdout)[::-1]
    assert [[raw(s) for s in task] for task in there] == [[raw(s) for s in task] for task in here]


# Budgets and limits.


def segment(
    maze: Maze,
    agent: Agent,
    stitcher: Stitcher,
    config: RolloutConfig,
    block: Block,
    budget: Sequence[int] | np.ndarray,
    cells: np.ndarray,
) -> tuple[Segments, Log, np.ndarray]:
    env, log = maze.vector_env(), Log()
    begin(env, block, cells)
    budget_array = np.array(budget)
    given = budget_array.copy()
    outcome = play_segment(env, agent, stitcher, maze, config, block, budget_array, log)
    assert np.array_equal(budget_array, given)
    return outcome, log, env.snapshot(np.arange(len(given)))


@each_method
@pytest.mark.parametrize("skill_limit", [0, 3])
@pytest.mark.parametrize("skill", ["a", "b", "c", "d"])
def test_no_episode_takes_more_than_its_budget(
    maze: Maze,
    agent: Agent,
    stitchers: dict[str, Stitcher],
    method: str,
    skill_limit: int,
    skill: str,
) -> None:
    cells = np.argwhere(maze.free).astype(float)
    budget = np.arange(len(cells)) % 14
    stitcher = stitchers[method]
    config = replace(SAMPLED, skill_limit=skill_limit)
    previous = "a" if skill != "a" else "b"
    block = block_of(method, (previous, skill), range(len(cells)))
    outcome, log, ends = segment(maze, agent, stitcher, config, block, budget, cells)

    assert (outcome.steps <= budget).all()
    assert (outcome.stitch_steps <= np.minimum(stitcher.limit, outcome.steps)).all()
    executed = outcome.steps - outcome.stitch_steps
    if skill_limit:
        assert (outcome.steps <= skill_limit).all()
    for row in range(len(cells)):
        assert log.count("stitch", row) == outcome.stitch_steps[row]
        assert log.count("execute", row) == executed[row]
    # Who failed has used up all there was.
    most = np.minimum(budget, skill_limit or 99)
    assert (outcome.steps == most)[~outcome.success].all()
    assert np.array_equal(outcome.snapshots, ends)
    assert np.array_equal(ends[budget == 0], cells[budget == 0])
    goal = dict(maze.goals)[skill]
    assert np.array_equal(outcome.success, (ends == goal).all(axis=1))
    assert 0 < outcome.success.sum() < len(cells)


@each_method
@pytest.mark.parametrize("step_limit", [1, 4, 11])
def test_a_task_stays_within_its_step_limit(
    maze: Maze, agent: Agent, stitchers: dict[str, Stitcher], method: str, step_limit: int
) -> None:
    for task in TASKS:
        log = Log()
        played = play_from_start(
            maze.vector_env(), agent, stitchers[method], maze, SAMPLED, block_of(method, task),
            step_limit, log,
        )  # fmt: skip
        used = np.zeros(6, dtype=np.int64)
        for segments in played:
            used = used + segments.steps
            assert (used <= step_limit).all()
            assert (used[~segments.success] == step_limit).all()
            used = used[segments.success]
        assert sum(len(rows) for _, rows, _ in log.steps) == sum(s.steps.sum() for s in played)


@each_method
def test_first_skills_are_not_stitched(
    maze: Maze, agent: Agent, stitchers: dict[str, Stitcher], method: str
) -> None:
    def first(stitcher: Stitcher, name: str) -> Segments:
        (segments,) = play_from_start(
            maze.vector_env(), agent, stitcher, maze, SAMPLED, block_of(name, ("b",)), STEP_LIMIT
        )
        return segments

    segments = first(stitchers[method], method)
    assert not segments.stitch_steps.any()
    assert segments.value_start.tobytes() == segments.value_end.tobytes()
    assert raw(segments) == raw(first(NoStitch(), ""))


def random_stitch(actions: ActionSpace, limit: int) -> RandomStitch:
    return RandomStitch(RandomStitchSettings(limit), Models(actions, 0, {}))


def test_a_limit_of_0_is_no_stitching(maze: Maze, agent: Agent) -> None:
    block = block_of("any", TASKS[0])
    none, limited = (
        play_from_start(maze.vector_env(), agent, stitcher, maze, SAMPLED, block, STEP_LIMIT)
        for stitcher in (NoStitch(), random_stitch(maze.actions, limit=0))
    )
    assert [raw(s) for s in none] == [raw(s) for s in limited]
    assert not any(s.stitch_steps.any() for s in none)


@each_method
def test_watching_changes_nothing(
    maze: Maze, agent: Agent, stitchers: dict[str, Stitcher], method: str
) -> None:
    block = block_of(method, TASKS[2])
    watched, unwatched = (
        play_from_start(
            maze.vector_env(), agent, stitchers[method], maze, SAMPLED, block, STEP_LIMIT, recorder
        )
        for recorder in (Log(), None)
    )
    assert [raw(s) for s in watched] == [raw(s) for s in unwatched]


def test_segments_have_the_declared_types(
    maze: Maze, agent: Agent, stitchers: dict[str, Stitcher]
) -> None:
    played = play_from_start(
        maze.vector_env(), agent, stitchers["mb-stitch"], maze, SAMPLED,
        block_of("mb-stitch", TASKS[0]), STEP_LIMIT,
    )  # fmt: skip
    alive = 6
    for segments in played:
        types = {f.name: getattr(segments, f.name).dtype for f in fields(Segments)}
        assert types == {
            "success": np.bool_,
            "stitch_steps": np.int64,
            "steps": np.int64,
            "value_start": np.float32,
            "value_end": np.float32,
            "snapshots": np.float64,
        }
        assert segments.snapshots.shape == (alive, maze.snapshot_size)
        assert {len(getattr(segments, name)) for name in types} == {alive}
        alive = int(segments.success.sum())


def test_nobody_plays(maze: Maze, agent: Agent, stitchers: dict[str, Stitcher]) -> None:
    for method in METHODS:
        (segments,) = play_from_start(
            maze.vector_env(), agent, stitchers[method], maze, SAMPLED,
            block_of(method, TASKS[0], ()), STEP_LIMIT,
        )  # fmt: skip
        assert len(segments.success) == 0
        block = block_of(method, ("a", "b"), ())
        nobody, log, _ = segment(
            maze, agent, stitchers[method], SAMPLED, block, [], np.zeros((0, 2))
        )
        assert len(nobody.success) == 0
        assert log.steps == []


def test_the_mode_leaves_nothing_to_chance(maze: Maze, agent: Agent) -> None:
    def paths(config: RolloutConfig) -> set[tuple[tuple[int, ...], ...]]:
        log = Log()
        play_from_start(
            maze.vector_env(), agent, NoStitch(), maze, config, block_of("no-stitch", ("c",)),
            STEP_LIMIT, log,
        )  # fmt: skip
        return {tuple(log.path(row)) for row in range(6)}

    assert len(paths(MODE)) == 1
    assert len(paths(SAMPLED)) > 1


# Common random numbers.


def keys(block: Block, purpose: str, *, by_method: bool = False) -> list[bytes]:
    return [stream.bytes(16) for stream in block.streams(purpose, by_method=by_method)]


def test_methods_share_environment_and_policy_but_not_planner_streams() -> None:
    ours, theirs = block_of("mb-stitch", ("a", "b")), block_of("no-stitch", ("a", "b"))
    for purpose in ("environment", "policy"):
        assert keys(ours, purpose) == keys(theirs, purpose)
    assert not set(keys(ours, "planner", by_method=True)) & set(
        keys(theirs, "planner", by_method=True)
    )


def test_every_episode_of_every_node_has_its_own_streams() -> None:
    block = block_of("m", ("a", "b"))
    others = [
        replace(block, root_seed=1),
        replace(block, benchmark="kitchen"),
        replace(block, seed=1),
        replace(block, prefix=("b", "a")),
        replace(block, prefix=("a",)),
        replace(block, prefix=("a", "b", "c")),
        replace(block, episodes=tuple(range(6, 12))),
    ]
    for settings in ({"purpose": "environment"}, {"purpose": "planner", "by_method": True}):
        found = [key for p in (block, *others) for key in keys(p, **settings)]
        assert len(set(found)) == len(found) == 6 * 8
    purposes = [key for purpose in ("environment", "policy", "x") for key in keys(block, purpose)]
    assert len(set(purposes)) == 18


def test_a_stream_goes_with_its_episode_not_with_its_row() -> None:
    forwards = block_of("m", ("a",), [3, 5, 9])
    backwards = block_of("m", ("a",), [9, 5, 3])
    assert keys(forwards, "policy") == keys(backwards, "policy")[::-1]


@dataclass(frozen=True)
class PlannerRecorder:
    """Takes one step and writes down what its streams held."""

    drawn: list[bytes]
    limit: int = 1
    before_first: ClassVar[bool] = False
    until_value_falls: ClassVar[bool] = True

    def propose(
        self,
        states: Tensor,
        previous: int | None,
        following: int,
        streams: Sequence[np.random.Generator],
    ) -> Proposal:
        self.drawn.extend(stream.bytes(16) for stream in streams)
        return Proposal.of(np.eye(4, dtype=np.float32)[np.zeros((len(streams), 1), dtype=int)])


def test_stitchers_draw_from_the_planner_streams_of_their_method(maze: Maze, agent: Agent) -> None:
    cells = np.array([[3.0, 1.0]] * 6)
    for method in ("one", "other"):
        drawn: list[bytes] = []
        block = block_of(method, ("a", "d"))
        segment(maze, agent, PlannerRecorder(drawn), SAMPLED, block, [5] * 6, cells)
        assert drawn == keys(block, "planner", by_method=True)


# An open floor. Weights are made by hand: V is a known linear function of the observation, and the
# policy always makes the move it is told.

SIDE = 13
UP, DOWN, LEFT, RIGHT = range(4)
FLOOR = Maze(
    layout=("#" * SIDE, *["#" + "." * (SIDE - 2) + "#"] * (SIDE - 2), "#" * SIDE),
    spawn=(6, 6),
    goals=(("home", (6, 6)), ("north", (1, 6)), ("corner", (11, 11))),
)
HOME, NORTH, CORNER = range(3)


def made_by_hand(v: np.ndarray, policy: np.ndarray, bias: np.ndarray) -> Agent:
    """Linear in observation and condition: v (members, in, 1), policy (1, in, 4), bias (4,)."""
    weights = {
        "observation_mean": np.zeros(FLOOR.observation_size),
        "observation_std": np.ones(FLOOR.observation_size),
        "v.w0": v,
        "v.b0": np.zeros((len(v), 1, 1)),
        "policy.w0": policy,
        "policy.b0": bias.reshape(1, 1, 4),
        "policy.log_std": np.zeros(4),
    }
    weights = {name: array.astype(np.float32) for name, array in weights.items()}
    return Agent(weights, conditions(FLOOR), FLOOR.actions)


def walker(
    v_row: Sequence[float] = (0.0,), v_col: Sequence[float] = (0.0,), move: int | None = RIGHT
) -> Agent:
    """V of member m is v_row[m] · row + v_col[m] · col; the policy moves so, or anyhow if None."""
    v = np.zeros((len(v_row), FLOOR.observation_size + 2, 1))
    v[:, 0, 0], v[:, 1, 0] = np.array(v_row) * SIDE, np.array(v_col) * SIDE
    likes = np.zeros(4) if move is None else 50 * np.eye(4)[move]
    return made_by_hand(v, np.zeros((1, FLOOR.observation_size + 2, 4)), likes)


@dataclass(frozen=True)
class Signposts:
    """In each row of the floor, the moves to make from there, whatever the column; where there
    are none, the stitch is not wanted."""

    signs: dict[int, list[int]]
    limit: int
    asked: list[int] = field(default_factory=list)  # how many episodes, each time
    before_first: ClassVar[bool] = False
    until_value_falls: ClassVar[bool] = True

    def propose(
        self,
        states: Tensor,
        previous: int | None,
        following: int,
        streams: Sequence[np.random.Generator],
    ) -> Proposal:
        assert (previous, following) == (HOME, CORNER) or following == NORTH
        assert len(states) == len(streams)
        self.asked.append(len(states))
        rows = np.rint(states[:, 0].numpy() * SIDE).astype(int)
        steps = len(next(iter(self.signs.values())))
        signs = [self.signs.get(row, [UP] * steps) for row in rows.tolist()]
        return Proposal(np.eye(4, dtype=np.float32)[signs], np.isin(rows, list(self.signs)))


class SignpostsPastTheTop(Signposts):
    """They are followed where the value falls, too."""

    until_value_falls: ClassVar[bool] = False


def on_the_floor(
    agent: Agent,
    stitcher: Stitcher,
    cells: Sequence[tuple[int, int]],
    budget: int = 30,
    skill: str = "corner",
    config: RolloutConfig = MODE,
) -> tuple[Segments, Log]:
    block = block_of("signposts", ("home", skill), range(len(cells)))
    outcome, log, _ = segment(
        FLOOR, agent, stitcher, config, block, [budget] * len(cells), np.array(cells, dtype=float)
    )
    return outcome, log


def test_a_stitch_ends_when_the_value_no_longer_rises() -> None:
    """V rises to the north. Row 4 turns sideways, where V stays; row 9 leads back south."""
    signs = {row: [UP] for row in range(1, 12)} | {4: [RIGHT], 9: [DOWN]}
    stitcher = Signposts(signs, limit=20)
    cells = [(4, 2), (5, 2), (8, 2), (9, 2), (10, 2)]
    outcome, log = on_the_floor(walker(v_row=[-1.0]), stitcher, cells)
    # The step that shows that V no longer rises is a step taken.
    assert outcome.stitch_steps.tolist() == [1, 2, 5, 1, 2]
    assert [log.path(row)[n - 1] for row, n in enumerate(outcome.stitch_steps)] == [
        (4, 3),
        (4, 3),
        (4, 3),
        (10, 2),
        (10, 2),
    ]
    np.testing.assert_allclose(outcome.value_start, [-4, -5, -8, -9, -10], rtol=1e-5)
    np.testing.assert_allclose(outcome.value_end, [-4, -4, -4, -10, -10], rtol=1e-5)
    assert stitcher.asked == [5, 3, 1, 1, 1]


def test_a_stitch_that_is_not_wanted_takes_no_step() -> None:
    """V rises to the north. There is no sign in rows 7 and 9: one has not begun, one has."""
    stitcher = Signposts({row: [UP] for row in (8, 10)}, limit=20)
    outcome, log = on_the_floor(walker(v_row=[-1.0]), stitcher, [(7, 2), (8, 2), (9, 2), (10, 2)])
    assert outcome.stitch_steps.tolist() == [0, 1, 0, 1]
    assert stitcher.asked == [4, 2]
    assert outcome.value_start[0] == outcome.value_end[0]
    assert [log.path(row)[0] for row in range(4)] == [(7, 3), (7, 2), (9, 3), (9, 2)]
    untouched, alone = on_the_floor(walker(v_row=[-1.0]), NoStitch(), [(7, 2)])
    assert log.path(0) == alone.path(0)
    assert outcome.steps[0] == untouched.steps[0]


def test_a_stitch_ends_at_its_limit() -> None:
    stitcher = Signposts({row: [UP] for row in range(1, 12)}, limit=3)
    outcome, _ = on_the_floor(walker(v_row=[-1.0]), stitcher, [(10, 2), (3, 2), (8, 8)])
    # From row 3 it is two steps to the wall, and a third to find that V stays.
    assert outcome.stitch_steps.tolist() == [3, 3, 3]
    assert stitcher.asked == [3, 3, 3]


def test_each_value_is_compared_with_the_last_not_the_first() -> None:
    """Two steps up, then one down: still above the start, and yet the end."""
    signs = {8: [UP], 7: [UP], 6: [DOWN]}
    outcome, _ = on_the_floor(walker(v_row=[-1.0]), Signposts(signs, limit=20), [(8, 2)])
    assert outcome.stitch_steps.tolist() == [3]
    np.testing.assert_allclose(outcome.value_end, [-7], rtol=1e-5)


def test_a_stitch_goes_on_where_the_value_falls_if_it_does_not_end_by_it() -> None:
    """North, where V rises, and south again and again, until the limit or where no sign is."""
    signs = {8: [UP], 7: [DOWN], 3: [DOWN], 4: [DOWN]}
    stitcher = SignpostsPastTheTop(signs, limit=6)
    outcome, _ = on_the_floor(walker(v_row=[-1.0]), stitcher, [(8, 2), (3, 2)])
    assert outcome.stitch_steps.tolist() == [6, 2]


def test_the_mean_over_the_members_decides() -> None:
    stitcher = Signposts({row: [UP] for row in range(1, 12)}, limit=4)
    cells = [(10, 2)]
    rising, _ = on_the_floor(walker(v_row=[2.0, -3.0], v_col=[0, 0]), stitcher, cells)
    falling, _ = on_the_floor(walker(v_row=[3.0, -2.0], v_col=[0, 0]), stitcher, cells)
    assert rising.stitch_steps.tolist() == [4]
    assert falling.stitch_steps.tolist() == [1]
    np.testing.assert_allclose(rising.value_start, [-5], rtol=1e-5)


def test_an_open_loop_plan_is_carried_out_whole() -> None:
    """V falls from the first step on; it is not looked at before the fifth."""
    signs = {row: [DOWN, DOWN, LEFT, UP, RIGHT] for row in range(1, 12)}
    stitcher = Signposts(signs, limit=5)
    outcome, log = on_the_floor(walker(v_row=[-1.0]), stitcher, [(3, 3), (5, 8)])
    assert outcome.stitch_steps.tolist() == [5, 5]
    assert stitcher.asked == [2]
    assert log.path(0)[:5] == [(4, 3), (5, 3), (5, 2), (4, 2), (4, 3)]
    assert log.path(1)[:5] == [(6, 8), (7, 8), (7, 7), (6, 7), (6, 8)]


@pytest.mark.parametrize(
    ("limit", "planned", "budget", "steps", "asked"),
    [
        (5, 3, 30, 5, [1, 1]),  # a second plan, cut at the limit
        (3, 5, 30, 3, [1]),
        (9, 3, 7, 7, [1, 1, 1]),  # cut by the budget
        (9, 3, 2, 2, [1]),
        (5, 3, 0, 0, []),
    ],
)
def test_a_plan_is_cut_at_the_limit_and_the_budget(
    limit: int, planned: int, budget: int, steps: int, asked: list[int]
) -> None:
    stitcher = Signposts({row: [UP] * planned for row in range(1, 12)}, limit)
    outcome, log = on_the_floor(walker(v_row=[-1.0]), stitcher, [(11, 2)], budget)
    assert outcome.stitch_steps.tolist() == [steps]
    assert stitcher.asked == asked
    assert log.path(0)[:steps] == [(11 - n, 2) for n in range(1, steps + 1)]
    assert outcome.steps.tolist() == [budget]


def test_a_plan_is_cut_at_success_and_the_others_go_on_with_theirs() -> None:
    """Each row has its own plan; (11, 9) reaches the corner in two, (11, 10) in one."""
    signs = {11: [RIGHT, RIGHT, UP, UP, LEFT], 3: [UP, RIGHT, DOWN, LEFT, LEFT]}
    cells = [(3, 3), (11, 9), (11, 3), (11, 10), (3, 8)]
    outcome, log = on_the_floor(walker(move=UP), Signposts(signs, limit=5), cells)
    assert outcome.stitch_steps.tolist() == [5, 2, 5, 1, 5]
    assert outcome.success.tolist() == [False, True, False, True, False]
    assert log.path(0)[:5] == [(2, 3), (2, 4), (3, 4), (3, 3), (3, 2)]
    assert log.path(2)[:5] == [(11, 4), (11, 5), (10, 5), (9, 5), (9, 4)]
    assert log.path(4)[:5] == [(2, 8), (2, 9), (3, 9), (3, 8), (3, 7)]
    assert log.path(1) == [(11, 10), (11, 11)]
    assert log.path(3) == [(11, 11)]


def test_success_while_stitching_counts_and_is_the_end() -> None:
    stitcher = Signposts({row: [UP] for row in range(1, 12)}, limit=9)
    outcome, log = on_the_floor(walker(v_row=[-1.0]), stitcher, [(4, 6), (5, 6)], skill="north")
    assert outcome.success.tolist() == [True, True]
    assert outcome.stitch_steps.tolist() == outcome.steps.tolist() == [3, 4]
    assert log.count("execute", 0) == log.count("execute", 1) == 0
    assert outcome.snapshots.tolist() == [[1, 6], [1, 6]]


def test_a_skill_that_already_holds_takes_no_step() -> None:
    stitcher = Signposts({row: [UP] for row in range(1, 12)}, limit=9)
    outcome, log = on_the_floor(
        walker(v_row=[-1.0]), stitcher, [(1, 6), (2, 6)], budget=1, skill="north"
    )
    assert outcome.success.tolist() == [True, True]
    assert outcome.steps.tolist() == [0, 1]
    assert log.count("stitch", 0) == 0


def test_the_policy_takes_over_where_the_stitch_ends() -> None:
    signs = {10: [DOWN], 11: [DOWN]}
    outcome, log = on_the_floor(walker(v_row=[1.0]), Signposts(signs, limit=9), [(10, 7)])
    # Down, then against the wall, where V stays; then right to the corner.
    assert log.path(0) == [(11, 7), (11, 7), (11, 8), (11, 9), (11, 10), (11, 11)]
    assert [phase for phase, _, _ in log.steps] == ["stitch"] * 2 + ["execute"] * 4
    assert outcome.success.tolist() == [True]
    assert (outcome.stitch_steps.tolist(), outcome.steps.tolist()) == ([2], [6])


def test_policy_and_values_are_asked_about_the_skill_being_played() -> None:
    """V and the liking for going up depend on the goal's row: 1 is north, 6 home, 11 the corner."""
    columns = FLOOR.observation_size
    policy, v = np.zeros((1, columns + 2, 4)), np.zeros((1, columns + 2, 1))
    policy[0, columns, UP], v[0, columns, 0] = -50 * SIDE, SIDE
    bias = 150 * np.eye(4)[UP] + np.eye(4)[RIGHT]
    agent = made_by_hand(v, policy, bias)
    north, log = on_the_floor(agent, NoStitch(), [(4, 6)], skill="north")
    assert log.path(0) == [(3, 6), (2, 6), (1, 6)]
    corner, log = on_the_floor(agent, NoStitch(), [(11, 9)], skill="corner")
    assert log.path(0) == [(11, 10), (11, 11)]
    for outcome, row in ((north, 1), (corner, 11)):
        np.testing.assert_allclose([outcome.value_start, outcome.value_end], row, rtol=1e-5)


def test_the_temperature_lies_between_the_mode_and_the_learned_policy() -> None:
    """Right is the likeliest move, by 0.71 at temperature 1 and by 0.33 at 5."""
    agent = made_by_hand(
        np.zeros((1, FLOOR.observation_size + 2, 1)),
        np.zeros((1, FLOOR.observation_size + 2, 4)),
        2 * np.eye(4)[RIGHT],
    )

    def to_the_right(temperature: float) -> float:
        """The share of first moves that go there, of 200 episodes."""
        config = RolloutConfig(temperature=temperature)
        ends = on_the_floor(agent, NoStitch(), [(6, 6)] * 200, budget=1, config=config)[0].snapshots
        return float((ends[:, 1] == 7).mean())

    assert to_the_right(0.0) == to_the_right(1e-3) == 1
    assert to_the_right(1.0) == pytest.approx(0.711, abs=0.1)
    assert to_the_right(5.0) == pytest.approx(0.332, abs=0.1)


def test_a_negative_temperature_is_refused() -> None:
    with pytest.raises(ValueError, match="temperature: must be at least 0"):
        RolloutConfig(temperature=-0.1)


@pytest.mark.parametrize(("limit", "success"), [(5, False), (6, True), (0, True)])
def test_a_skill_has_its_own_limit_stitching_included(limit: int, success: bool) -> None:
    signs = {10: [DOWN], 11: [DOWN]}
    outcome, _ = on_the_floor(
        walker(v_row=[1.0]), Signposts(signs, limit=9), [(10, 7)],
        config=RolloutConfig(skill_limit=limit),
    )  # fmt: skip
    assert outcome.success.tolist() == [success]
    assert outcome.steps.tolist() == [6 if success else 5]


@pytest.mark.parametrize(("alpha", "steps"), [(0.0, 3), (0.4, 3), (1.0, 1)])
def test_the_stop_rule_watches_the_ensemble_value(alpha: float, steps: int) -> None:
    """To the right the mean value rises by 1 a step, and the members' disagreement by 2."""
    outcome, _ = on_the_floor(
        walker(v_row=[0.0, 0.0], v_col=[3.0, -1.0]),
        Signposts({row: [RIGHT] for row in range(1, 12)}, limit=3),
        [(4, 2)],
        config=RolloutConfig(stop_alpha=alpha),
    )
    assert outcome.stitch_steps.tolist() == [steps]
    slope = 1 - 2 * alpha
    np.testing.assert_allclose(outcome.value_start, [2 * slope], rtol=1e-5)
    np.testing.assert_allclose(outcome.value_end, [(2 + steps) * slope], rtol=1e-5)


def displacements(stitcher: Stitcher, method: str) -> list[list[tuple[int, int]]]:
    """The executed moves of each episode, by a policy of pure chance far from any wall."""
    cells = [(6, col) for col in (5, 6, 7)] * 2
    block = block_of(method, ("home", "corner"))
    env, log = MazeVectorEnv(FLOOR), Log()
    begin(env, block, np.array(cells, dtype=float))
    agent = walker(v_row=[-1.0], move=None)
    config = replace(SAMPLED, skill_limit=6)
    play_segment(env, agent, stitcher, FLOOR, config, block, np.full(6, 20), log)
    executed = []
    for row in range(6):
        steps = [
            (phase, snapshots[rows.index(row)])
            for phase, rows, snapshots in [("start", list(range(6)), np.array(cells)), *log.steps]
            if row in rows
        ]
        moves = []
        for (_, before), (phase, after) in pairwise(steps):
            if phase == "execute":
                moves.append(tuple((after - before).astype(int).tolist()))
        executed.append(moves[:4])  # as many as the longest stitch leaves
    return executed


def test_policies_meet_the_same_chance_after_any_stitch() -> None:
    none = displacements(NoStitch(), "no-stitch")
    assert len({tuple(moves) for moves in none}) > 3
    assert all(len(moves) == 4 for moves in none)
    random = displacements(random_stitch(FLOOR.actions, limit=2), "random-stitch")
    posts = displacements(Signposts({row: [DOWN] for row in range(1, 12)}, limit=1), "signposts")
    assert random == none == posts


def test_snapshots_are_taken_where_each_episode_stopped() -> None:
    outcome, log = on_the_floor(walker(), NoStitch(), [(11, 3), (11, 9), (4, 4)], budget=4)
    assert outcome.snapshots.tolist() == [[11, 7], [11, 11], [4, 8]]
    assert outcome.steps.tolist() == [4, 2, 4]
    for row in range(3):
        assert log.path(row)[-1] == tuple(outcome.snapshots[row].astype(int).tolist())


def test_a_task_ends_when_nobody_is_left() -> None:
    """From home the policy only goes right: north is never reached, nor anything after it."""
    block = block_of("no-stitch", ("north", "corner"))
    played = play_from_start(FLOOR.vector_env(), walker(), NoStitch(), FLOOR, MODE, block, 20)
    assert len(played) == 1
    assert not played[0].success.any()
    assert (played[0].steps == 20).all()


def test_policy_noise_is_each_streams_own() -> None:
    uniform = policy_noise(MOVES, streams(500))
    normal = policy_noise(ARM, streams(500))
    assert (uniform.shape, normal.shape) == ((500, 1), (500, 2))
    assert uniform.dtype == normal.dtype == np.float32
    assert 0 <= uniform.min() < 0.05 < 0.95 < uniform.max() <= 1
    assert abs(normal.mean()) < 0.1
    assert normal.std() == pytest.approx(1, abs=0.1)
    for space, noise in ((MOVES, uniform), (ARM, normal)):
        assert np.array_equal(policy_noise(space, streams(500)[7:9]), noise[7:9])

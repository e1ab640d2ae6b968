"""The rollout tree on the serial executor: who plays, what is tried again, what is given up."""

from collections import Counter
from collections.abc import Callable, Iterator

import numpy as np
import pandas as pd
import pytest

from orchestrator.errors import IncompleteError
from orchestrator.executors.serial import SerialExecutor
from orchestrator.spec.spec import Spec
from orchestrator.work import playing
from orchestrator.work.evaluation import Evaluation
from orchestrator.work.jobs import ATTEMPTS, Job, PlayJob, Report
from orchestrator.work.plan import Node, Plan
from stitching.envs.protocol import Benchmark, VectorEnv
from stitching.methods.protocol import Stitcher
from stitching.models.agent import Agent
from stitching.rollout import Block, Recorder, RolloutConfig, Segments, play_segment
from tests.orchestrator.tiny import Counted, Lines, Place, promised_bytes


def test_only_survivors_are_played_on(finished: Place, plan: Plan) -> None:
    ledger = finished.directory.ledger(read_only=True)
    outcomes = dict(ledger.outcomes(task.key for task in plan.tasks.values()))
    ledger.close()
    skipped = 0
    for (node, chunk), task in plan.tasks.items():
        if node.parent is None:
            assert list(outcomes[task.key].arrays["episode"]) == list(range(*task.episodes))
            continue
        parent = outcomes[plan.tasks[node.parent, chunk].key].arrays
        survivors = parent["episode"][parent["success"]]
        if len(survivors):
            assert (outcomes[task.key].arrays["episode"] == survivors).all()
        else:
            assert task.key not in outcomes
            skipped += 1
    assert skipped


# Faults of single blocks


Break = Callable[..., None]


@pytest.fixture
def break_blocks(monkeypatch: pytest.MonkeyPatch) -> Iterator[Break]:
    """Make blocks raise while they are played: those a condition holds for, so many times."""

    def break_blocks(broken: Callable[[Block], bool], times: int = 10**9) -> None:
        left = Counter[Block]()

        def faulty(
            env: VectorEnv,
            agent: Agent,
            stitcher: Stitcher,
            benchmark: Benchmark,
            config: RolloutConfig,
            block: Block,
            budget: np.ndarray,
            recorder: Recorder | None,
        ) -> Segments:
            left[block] += 1
            if broken(block) and left[block] <= times:
                raise RuntimeError("the simulator fell over")
            return play_segment(env, agent, stitcher, benchmark, config, block, budget, recorder)

        monkeypatch.setattr(playing, "play_segment", faulty)

    yield break_blocks
    monkeypatch.setattr(playing, "play_segment", play_segment)


@pytest.mark.parametrize("times", [1, ATTEMPTS - 1])
def test_a_passing_fault_is_overcome(
    spec: Spec, trained: Place, expected: dict[str, bytes], break_blocks: Break, times: int
) -> None:
    break_blocks(lambda block: block.prefix[-1] == "g1", times)
    trained.carry_out(spec)
    assert promised_bytes(trained.out) == expected
    assert trained.directory.read_json("quarantine.json") == []
    ledger = trained.directory.ledger(read_only=True)
    failures = ledger.failures()
    ledger.close()
    assert {attempts for attempts, _ in failures.values()} == {times}
    assert all("the simulator fell over" in error for _, error in failures.values())


def test_a_block_that_keeps_failing_is_given_up_and_the_rest_finishes(
    spec: Spec,
    plan: Plan,
    trained: Place,
    finished: Place,
    expected: dict[str, bytes],
    counted: Counted,
    break_blocks: Break,
) -> None:
    """Episodes 4 and 5 of seed 1's first skill g0: with them go all their later skills."""
    break_blocks(lambda block: (block.seed, block.prefix, block.episodes) == (1, ("g0",), (4, 5)))
    lines = Lines()
    with pytest.raises(
        IncompleteError, match=r"1 blocks were given up .*quarantine\.json"
    ) as caught:
        trained.carry_out(spec, lines)
    assert caught.value.exit_code == 3

    key = plan.tasks[Node(1, "", ("g0",)), 1].key
    assert counted.played[key] == ATTEMPTS
    below = {
        task.key
        for (node, chunk), task in plan.tasks.items()
        if (node.seed, node.prefix[0], chunk) == (1, "g0", 1)
    }
    assert trained.finished_blocks() == finished.finished_blocks() - below
    (entry,) = trained.directory.read_json("quarantine.json")
    assert "the simulator fell over" in entry.pop("error")
    assert entry == {"seed": 1, "method": "", "prefix": "g0", "episodes": [4, 5]}
    assert "given up after 3 attempts: seed 1, g0, episodes 4–5" in lines.text
    assert not trained.directory.finished

    episodes = pd.read_parquet(trained.out / "episodes.parquet")
    whole = pd.read_parquet(finished.out / "episodes.parquet")
    lost = (whole["seed"] == 1) & whole["task"].str.startswith("g0") & (whole["episode"] >= 4)
    pd.testing.assert_frame_equal(episodes, whole[~lost].reset_index(drop=True))
    scores = pd.read_csv(trained.out / "report" / "table1.csv")
    asked = len(spec.all_tasks) * spec.seeds * spec.episodes
    begun = sum(task[0] == "g0" for task in spec.all_tasks)
    assert (scores["episodes"] == asked - begun * 2).all()
    assert "partial" in (trained.out / "report" / "table1.md").read_text().lower()

    counted.played.clear()
    break_blocks(lambda block: False)
    trained.carry_out(spec)
    assert key in counted.played
    assert set(counted.played) <= below
    assert promised_bytes(trained.out) == expected
    assert trained.directory.finished


def test_blocks_given_up_are_tried_again_by_every_command(
    spec: Spec, trained: Place, counted: Counted, break_blocks: Break
) -> None:
    break_blocks(lambda block: (block.seed, block.prefix, block.episodes) == (1, ("g0",), (4, 5)))
    for _ in range(2):
        with pytest.raises(IncompleteError):
            trained.carry_out(spec)
    assert max(counted.played.values()) == 2 * ATTEMPTS
    assert len(trained.directory.read_json("quarantine.json")) == 1


def test_a_run_in_which_no_block_can_be_played_says_so(
    spec: Spec, plan: Plan, trained: Place, break_blocks: Break
) -> None:
    break_blocks(lambda block: True)
    with pytest.raises(IncompleteError, match=rf"{len(list(plan.roots())) * 2} blocks"):
        trained.carry_out(spec)


# Workers that die


class Deadly(SerialExecutor):
    """A worker that dies, with whatever it holds, on certain blocks."""

    def __init__(self, deadly: set[str], deaths: int) -> None:
        super().__init__()
        self.deadly, self.deaths = deadly, deaths
        self.submitted: list[list[str]] = []

    def submit(self, job: Job) -> None:
        if isinstance(job, PlayJob):
            self.submitted.append([task.key for task, _ in job.tasks])
        super().submit(job)

    def next(self) -> Report:
        job = self._jobs[0]
        if isinstance(job, PlayJob) and self.deaths and self.deadly & {t.key for t, _ in job.tasks}:
            self.deaths -= 1
            self._jobs.popleft()
            return Report(job, trouble="lost", error="the worker died")
        return super().next()


def evaluation(plan: Plan, place: Place, executor: SerialExecutor) -> tuple[Evaluation, Lines]:
    lines = Lines()
    place.out.mkdir(exist_ok=True)
    ledger = place.directory.ledger()
    return Evaluation(plan, place.store, ledger, place.shared(), executor, lines), lines


@pytest.fixture
def deadly_block(plan: Plan) -> str:
    return plan.tasks[Node(0, "", ("g2",)), 0].key


def test_a_worker_lost_with_several_blocks_has_them_sent_singly(
    plan: Plan, trained: Place, finished: Place, deadly_block: str
) -> None:
    executor = Deadly({deadly_block}, deaths=1)
    work, _ = evaluation(plan, trained, executor)
    work.run()
    (lost,) = [keys for keys in executor.submitted if deadly_block in keys and len(keys) > 1]
    assert all([key] in executor.submitted for key in lost)
    assert work.ledger.failures() == {}  # any of them may be innocent
    assert work.ledger.finished() == finished.finished_blocks()


def test_a_block_that_kills_its_worker_is_given_up_and_its_neighbours_are_not(
    plan: Plan, trained: Place, deadly_block: str
) -> None:
    executor = Deadly({deadly_block}, deaths=10**9)
    work, lines = evaluation(plan, trained, executor)
    work.run()
    assert work.ledger.failures() == {deadly_block: (ATTEMPTS, "the worker died")}
    assert executor.submitted.count([deadly_block]) == ATTEMPTS
    assert "given up after 3 attempts: seed 0, g2, episodes 0–3: the worker died" in lines.text

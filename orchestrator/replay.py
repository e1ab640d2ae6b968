"""An episode of a run's ledger, played again step by step: for films and for a closer look."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from analysis.schema import SEPARATOR
from orchestrator.benchmarks.registry import ENTRIES
from orchestrator.errors import NondeterminismError, UsageError
from orchestrator.spec.structure import Plain
from orchestrator.storage.claim import spec_of
from orchestrator.storage.ledger import Ledger, Outcome
from orchestrator.storage.rundir import RunDirectory
from orchestrator.storage.store import Store
from orchestrator.work.jobs import BlockTask
from orchestrator.work.plan import Node, Plan, make_plan
from orchestrator.work.playing import BlockPlayer
from orchestrator.work.worker import use_one_thread
from stitching.models.agent import Agent
from stitching.studies.showcase.recorder import EpisodeRecorder


@dataclass(frozen=True)
class Asked:
    """Which episode: one number of a task's, by a method with the models of a seed."""

    task: tuple[str, ...]
    method: str
    seed: int = 0
    episode: int | None = None  # default: the first that accomplishes most


def replay(directory: RunDirectory, asked: Asked, store_root: Path | None = None) -> Plain:
    """The episode as a showcase with one episode: see `stitching.studies.showcase`.

    The whole blocks that it belongs to are played, as they were, and compared with the ledger.

    Raises UsageError where the run has no such episode, has not played it, or was played by other
    code; NondeterminismError where the same block does something else than on record.
    """
    plan, ledger = make_plan(spec_of(directory)), directory.ledger(read_only=True)
    try:
        path = _path(plan, asked)
        number = _most_accomplished(plan, ledger, path) if asked.episode is None else asked.episode
        return _play(plan, ledger, Store(store_root or directory.store_root), path, number, asked)
    finally:
        ledger.close()


def _path(plan: Plan, asked: Asked) -> list[Node]:
    """The nodes from a task's first skill to its last. UsageError where the run has none."""
    spec, task = plan.spec, SEPARATOR.join(asked.task)
    if asked.task not in spec.all_tasks:
        raise UsageError(f"{spec.name} has no task {task!r}; it has {_some(spec.all_tasks)}")
    if asked.method not in spec.methods:
        raise UsageError(f"no method {asked.method!r} there; there are {', '.join(spec.methods)}")
    if not 0 <= asked.seed < spec.seeds:
        raise UsageError(f"no seed {asked.seed} there; there are {spec.seeds}, from 0")
    if asked.episode is not None and not 0 <= asked.episode < spec.episodes:
        raise UsageError(f"no episode {asked.episode} there; there are {spec.episodes}, from 0")
    # A first skill may be shared: then no node of this prefix has the method's name.
    last = next(
        node
        for node in reversed(plan.nodes)
        if (node.seed, node.prefix) == (asked.seed, asked.task)
        and node.method in (asked.method, plan.first_method(asked.method))
    )
    path = [last]
    while path[0].parent is not None:
        path.insert(0, path[0].parent)
    return path


def _some(tasks: Sequence[tuple[str, ...]]) -> str:
    names = [SEPARATOR.join(task) for task in tasks[:3]]
    return ", ".join(names) + (f" and {len(tasks) - 3} more" if len(tasks) > 3 else "")


def _recorded(ledger: Ledger, task: BlockTask) -> Outcome | None:
    return next((outcome for _, outcome in ledger.outcomes([task.key])), None)


def _most_accomplished(plan: Plan, ledger: Ledger, path: list[Node]) -> int:
    """The first of the episodes that accomplish most of the task's skills."""
    best, most = 0, -1
    for depth, node in enumerate(path):
        for chunk, _ in enumerate(plan.chunks):
            outcome = _recorded(ledger, plan.tasks[node, chunk])
            if outcome is None:
                continue
            numbers, success = outcome.arrays["episode"], outcome.arrays["success"]
            for number, accomplished in zip(numbers.tolist(), success.tolist(), strict=True):
                reached = depth + accomplished
                if reached > most:
                    best, most = number, reached
    return best


def _play(
    plan: Plan, ledger: Ledger, store: Store, path: list[Node], number: int, asked: Asked
) -> Plain:
    use_one_thread()
    chunk = next(c for c, (first, end) in enumerate(plan.chunks) if first <= number < end)
    player, recorder = BlockPlayer(), None
    numbers: list[int] = []  # of the task's skill, at each step
    parent, accomplished = None, 0
    for place, node in enumerate(path):
        task = plan.tasks[node, chunk]
        known = _recorded(ledger, task)
        if known is None:
            raise UsageError(
                f"{task.name} is not on record: the run has not come to it, or other code or "
                "settings played it (status says how far it is, its report which revision made it)"
            )
        artifacts = {
            key: store.read(plan.recipes[key].kind, key) for key in task.artifacts.values()
        }
        if recorder is None:
            recorder = _recorder(plan.spec.benchmark, player.policy(task, artifacts))
        outcome = player.outcome(task, parent, artifacts, recorder)
        if outcome.to_bytes() != known.to_bytes():
            raise NondeterminismError(f"{task.name} did something else than what is on record")
        (row,) = (outcome.arrays["episode"] == number).nonzero()[0]
        numbers += [place] * int(outcome.arrays["steps"][row])
        if not outcome.arrays["success"][row]:
            break
        parent, accomplished = outcome, accomplished + 1
    assert recorder is not None
    episode = {
        "method": asked.method,
        "task": SEPARATOR.join(asked.task),
        "accomplished": accomplished,
        "segment": numbers,
        **recorder.episode(number),
    }
    shown = {"task": SEPARATOR.join(asked.task), "episode": number, "episodes": [episode]}
    return recorder.scene() | shown


def _recorder(benchmark: str, policy: Agent) -> EpisodeRecorder:
    make = ENTRIES[benchmark].recorder
    if make is None:
        raise UsageError(f"nobody has said how to record {benchmark}: its entry has no `recorder`")
    return make(policy)

"""From segments to episodes: reads the result of every task off the rollout tree.

A task's episode is the walk g0, g0>g1, g0>g1>g2 through the tree. Nothing is simulated here: the
tree was played to the longest step limit, and a shorter limit is applied by cutting afterwards.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from analysis.files import replaced_file
from analysis.run import load_run
from analysis.schema import EPISODES, SEPARATOR, RunError, RunSpec, task_length

COLUMNS = ["seed", "method", "task", "length", "episode", "accomplished", "score", "steps"]
ABSENT, FAILED, SUCCEEDED = -1, 0, 1


@dataclass(frozen=True)
class _Nodes:
    """All segments of one method as dense arrays, (prefixes, seeds, episodes)."""

    outcome: np.ndarray  # ABSENT, FAILED or SUCCEEDED
    end_step: np.ndarray  # steps of the episode up to the end of the segment
    given_up: np.ndarray  # whether the segment's block was quarantined, reached or not


def episodes_from_segments(
    segments: pd.DataFrame, spec: RunSpec, quarantine: Iterable[Mapping[str, Any]] = ()
) -> pd.DataFrame:
    """One row per (method, task, seed, episode) whose result is known, in the spec's order.

    Columns as in COLUMNS; score = accomplished / length. What was never played (quarantined
    blocks, a run still under way) is left out, never taken for failures, and for a task it is left
    out by whole blocks: were episodes kept that had failed before the missing segment, those that
    are missing would be the better ones. A block of which no episode came that far has nothing
    missing, and stays.
    """
    given_up = list(quarantine)
    if segments.duplicated(["seed", "method", "prefix", "episode"]).any():
        raise RunError("segments.parquet holds a segment twice: the run directory is damaged")
    frames = []
    for part in spec.by_part:
        prefixes = _prefixes(part.tasks)
        lengths = sorted({task_length(task) for task in part.tasks})
        for method in part.methods:
            nodes = _nodes_of_method(segments, method, prefixes, part, given_up)
            for length in lengths:
                tasks = [task for task in part.tasks if task_length(task) == length]
                frames.append(_play(nodes, method, tasks, prefixes, part))
    return pd.concat(frames, ignore_index=True)


def beginnings(
    segments: pd.DataFrame,
    spec: RunSpec,
    method: str,
    quarantine: Iterable[Mapping[str, Any]] = (),
) -> pd.DataFrame:
    """Episodes of a method's first skills and of its first two, as if these were tasks.

    Each beginning of a task once, within the step limit of two skills. COLUMNS and success: 1.0
    where every skill was accomplished.
    """
    walks = [_walk(task) for task in spec.tasks]
    tasks = dict.fromkeys(walk[depth] for depth in (0, 1) for walk in walks if len(walk) > depth)
    limit = spec.step_limits.get(2, max(spec.step_limits.values()))
    short = replace(
        spec,
        methods={method: spec.methods[method]},
        tasks=tuple(tasks),
        step_limits={1: limit, 2: limit},
    )
    episodes = episodes_from_segments(segments, short, quarantine)
    return episodes.assign(success=(episodes["accomplished"] == episodes["length"]).astype(float))


def write_episodes(run_dir: Path) -> pd.DataFrame:
    """Writes `episodes.parquet` of a run directory, and returns it."""
    run = load_run(run_dir)
    episodes = episodes_from_segments(run.segments, run.spec, run.quarantine)
    with replaced_file(run_dir / EPISODES) as draft:
        episodes.to_parquet(draft, index=False)
    return episodes


def _prefixes(tasks: tuple[str, ...]) -> dict[str, int]:
    """Every node that some task walks through -> its place in the dense arrays."""
    numbered: dict[str, int] = {}
    for task in tasks:
        for prefix in _walk(task):
            numbered.setdefault(prefix, len(numbered))
    return numbered


def _walk(task: str) -> list[str]:
    skills = task.split(SEPARATOR)
    return [SEPARATOR.join(skills[: depth + 1]) for depth in range(len(skills))]


def _nodes_of_method(
    segments: pd.DataFrame,
    method: str,
    prefixes: dict[str, int],
    spec: RunSpec,
    quarantine: list[Mapping[str, Any]],
) -> _Nodes:
    """The method's segments, with the first skills it shares with others.

    A first skill that is not stitched to is filed under method "". A method that stitches to it, or
    has other policies (Single-Policy, another dataset level), has first skills of its own.
    """
    first = segments["depth"] == 1
    own = segments["method"] == method
    if method in spec.own_first_skill:
        rows = segments[own]
    elif (first & own).any():
        raise RunError(
            f'{method} has first skills of its own: mark it "own_first_skill": true in spec.json'
        )
    else:
        rows = segments[(first & (segments["method"] == "")) | own]

    node = rows["prefix"].map(prefixes).to_numpy(dtype=float)
    seed = rows["seed"].map({seed: i for i, seed in enumerate(spec.seeds)}).to_numpy(dtype=float)
    episode = rows["episode"].to_numpy()
    asked = ~np.isnan(node) & ~np.isnan(seed) & (episode < spec.episodes)
    place = node[asked].astype(int), seed[asked].astype(int), episode[asked]

    shape = (len(prefixes), len(spec.seeds), spec.episodes)
    outcome = np.full(shape, ABSENT, dtype=np.int8)
    end_step = np.zeros(shape, dtype=np.int64)
    outcome[place] = rows["success"].to_numpy(dtype=bool)[asked]
    end_step[place] = rows["end_step"].to_numpy()[asked]
    given_up = np.zeros(shape, dtype=bool)
    for block in quarantine:
        shared = block["method"] == "" and method not in spec.own_first_skill
        asked_for = block["prefix"] in prefixes and block["seed"] in spec.seeds
        if asked_for and (shared or block["method"] == method):
            lost = [episode for episode in block["episodes"] if episode < spec.episodes]
            given_up[prefixes[block["prefix"]], spec.seeds.index(block["seed"]), lost] = True
    return _Nodes(outcome, end_step, given_up)


def _play(
    nodes: _Nodes, method: str, tasks: list[str], prefixes: dict[str, int], spec: RunSpec
) -> pd.DataFrame:
    """Walks all tasks of one length at once; arrays are (tasks, seeds, episodes)."""
    length = task_length(tasks[0])
    limit = spec.step_limits[length]
    walks = np.array([[prefixes[prefix] for prefix in _walk(task)] for task in tasks])

    shape = (len(tasks), len(spec.seeds), spec.episodes)
    accomplished = np.zeros(shape, dtype=np.int64)
    steps = np.zeros(shape, dtype=np.int64)
    going_on = np.ones(shape, dtype=bool)  # every skill so far accomplished, within the limit
    known = np.ones(shape, dtype=bool)
    for depth in range(length):
        outcome = nodes.outcome[walks[:, depth]]
        end_step = nodes.end_step[walks[:, depth]]
        # With no step left there may be no next segment, and the result is known without it.
        known &= ~(going_on & (outcome == ABSENT) & (steps < limit))
        known &= ~nodes.given_up[walks[:, depth]]
        played = going_on & (outcome != ABSENT)
        steps = np.where(played, np.minimum(end_step, limit), steps)
        going_on = played & (outcome == SUCCEEDED) & (end_step <= limit)
        accomplished += going_on

    known = _whole_blocks(known, spec.block_episodes)
    task, seed, episode = np.nonzero(known)
    return pd.DataFrame(
        {
            "seed": np.array(spec.seeds, dtype=np.int64)[seed],
            "method": method,
            "task": np.array(tasks, dtype=object)[task],
            "length": length,
            "episode": episode,
            "accomplished": accomplished[known],
            "score": accomplished[known] / length,
            "steps": steps[known],
        },
        columns=COLUMNS,
    )


def _whole_blocks(known: np.ndarray, block_episodes: int) -> np.ndarray:
    """Takes a task's block of episodes for unknown if one of them is: (tasks, seeds, episodes)."""
    episodes = known.shape[2]
    starts = np.arange(0, episodes, block_episodes)
    whole = np.logical_and.reduceat(known, starts, axis=2)
    return np.repeat(whole, np.diff(starts, append=episodes), axis=2)

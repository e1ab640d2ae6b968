"""`skillstitch check-data`: what people's own data hold, and whether a run would take them.

The same code reads them as in a run, and refuses the same.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import fields
from typing import Any

import numpy as np

from analysis.studies.data import left_out
from orchestrator.benchmarks.registry import ENTRIES
from orchestrator.errors import UsageError
from orchestrator.spec.spec import Spec
from orchestrator.spec.structure import structure, to_plain
from orchestrator.spec.suite import load_asked
from orchestrator.spec.tomls import packaged_specs
from orchestrator.storage.datasets import own_data
from orchestrator.work.recipes import Recipe
from stitching.data.transitions import NO_SKILL, Transitions
from stitching.envs.protocol import Benchmark
from stitching.streams import stream

STARTS = 8  # episodes whose first observation is compared with the data


def check_data_lines(source: str, benchmark: str) -> Iterator[str]:
    """What the data hold, skill by skill, and what they leave out.

    Raises UsageError where there are none or no such benchmark, BadDataError where they cannot be
    used.
    """
    takers = [name for name, each in ENTRIES.items() if _takes_files(each.data)]
    if benchmark not in takers:
        raise UsageError(f"no benchmark {benchmark!r} that takes own data: {', '.join(takers)} do")
    entry = ENTRIES[benchmark]
    config = structure(entry.data, {"file": source}, "data")
    (dataset,) = entry.datasets(config).values()
    params = {"benchmark": benchmark, "config": to_plain(config), **dataset.params}
    artifact = own_data(Recipe(dataset.kind, params))
    data = Transitions(**artifact.arrays)
    yield f"{source}: can be learned from as data of {benchmark}"
    demonstrations = int((data.episode_skills != NO_SKILL).sum())
    yield f"{demonstrations} demonstrations of skills; {len(data)} transitions in all"
    yield from _skill_lines(data, entry.benchmark)
    yield from _range_lines(data, entry.benchmark)
    yield from _task_lines(data, entry.benchmark)


def _takes_files(data: type[Any]) -> bool:
    return "file" in (field.name for field in fields(data))


def _skill_lines(data: Transitions, benchmark: Benchmark) -> Iterator[str]:
    """Demonstrations, successes and lengths of each skill."""
    lengths = np.diff(data.episode_ends, prepend=0)
    rows = {skill.name: number for number, skill in enumerate(benchmark.skills)}
    if (data.episode_skills == NO_SKILL).any():
        rows["(no skill)"] = NO_SKILL
    width = max(len(name) for name in ("skill", *rows))
    yield f"  {'skill':<{width}}  demonstrations  successes  steps: least  median   most"
    for name, number in rows.items():
        shown = data.episode_skills == number
        steps = lengths[shown]
        successes = int(data.episode_successes[shown].sum())
        line = f"  {name:<{width}}  {len(steps):>14}  {successes:>9}"
        if len(steps):
            line += f"  {steps.min():>12}  {np.median(steps):>6.0f}  {steps.max():>5}"
        yield line


def _range_lines(data: Transitions, benchmark: Benchmark) -> Iterator[str]:
    """What is observed in the data, and in the benchmark where episodes start: units, order."""
    env = benchmark.vector_env()
    env.reset([stream("check-data", benchmark.name, number) for number in range(STARTS)])
    starts = env.observe(np.arange(STARTS))
    low, high = data.observations.min(axis=0), data.observations.max(axis=0)
    first, last = starts.min(axis=0), starts.max(axis=0)
    parts = _parts(benchmark)
    width = max(len(name) for name in ("observations", *parts))
    yield f"  {'observations':<{width}}  {'in the data':>18}  at an episode's start"
    for name, columns in parts.items():
        ours = f"{low[columns].min():.2f} to {high[columns].max():.2f}"
        theirs = f"{first[columns].min():.2f} to {last[columns].max():.2f}"
        yield f"  {name:<{width}}  {ours:>18}  {theirs:>21}"
    span = np.maximum(high - low, last - first)
    if (far := np.flatnonzero((first > high + span) | (last < low - span))).size:
        numbers = ", ".join(map(str, far))
        yield (
            f"  far from the benchmark's start in all of the data: numbers {numbers} of an "
            "observation; are units and order the benchmark's?"
        )


def _parts(benchmark: Benchmark) -> dict[str, list[int]]:
    """Columns of an observation by what they are of."""
    factors = benchmark.factors
    parts = {"robot": list(factors.pose)}
    parts |= {name: factors.objects[name].columns for name in factors.names}
    named = {column for columns in parts.values() for column in columns}
    parts["others"] = [c for c in range(benchmark.observation_size) if c not in named]
    return {name: columns for name, columns in parts.items() if columns}


def _task_lines(data: Transitions, benchmark: Benchmark) -> Iterator[str]:
    """Which tasks of the packaged specs ask for a skill that nothing accomplishes."""
    names = [skill.name for skill in benchmark.skills]
    shown = {names[skill] for skill in data.episode_skills[data.episode_successes]}
    if not (missing := [name for name in names if name not in shown]):
        yield "every skill is accomplished by some demonstration"
        return
    yield f"no demonstration accomplishes {', '.join(missing)}; these tasks ask for one of them:"
    for name in packaged_specs():
        asked = load_asked(name)
        if isinstance(asked, Spec) and asked.benchmark == benchmark.name:
            tasks = asked.all_tasks
            without = sum(bool(left_out(names, [task], shown)) for task in tasks)
            yield f"  {name}: {without} of {len(tasks)}"

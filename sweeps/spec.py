"""What is to be searched, as a frozen dataclass read from a TOML file."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from importlib import resources
from pathlib import Path
from typing import Any, Literal

from orchestrator.errors import UsageError
from orchestrator.spec.spec import (
    Spec,
    TableSpec,
    load_spec,
    spec_from_plain,
)
from orchestrator.spec.structure import Plain, merged, settings_of, structure, to_plain
from orchestrator.spec.tomls import Scale, at_scale, read_toml, toml_names
from stitching.bounds import (
    Amount,
    Bounded,
    Count,
    Episodes,
    Inside,
    Seed,
    SeedNumber,
    ShareBelowOne,
)
from stitching.streams import stream
from sweeps.questions import METRICS, question_of
from sweeps.questions.question import Question
from sweeps.space import Space, Value, check_enqueued, check_space, grid_points


@dataclass(frozen=True)
class Pruner(Bounded):
    """Gives up trials that Wilcoxon's signed-rank test tells from the best one so far."""

    rounds: Count = 1  # parts in which a trial is played, the test after each; 1: never pruned
    p: Inside = 0.1  # given up below this p-value
    startup: Amount = 12  # instances (task, episode) before the first test


@dataclass(frozen=True)
class Confirm(Bounded):
    """How the best trials are judged again, where the search has never been."""

    best: Amount = 3  # trials; 0: none
    seeds: tuple[SeedNumber, ...] = ()  # default: as many as the search had, after them
    root_seed: Seed | None = None  # another one makes other data, too; default: the base's
    episodes: Episodes | None = None  # default: the base's


@dataclass(frozen=True)
class SweepSpec(Bounded):
    """A search over fields of a run spec."""

    name: str
    title: str
    base: str  # name or file of a run spec, taken at the sweep's own scale
    space: Space
    scale: Scale = "paper"
    settings: Plain = field(default_factory=dict)  # fields of the base, changed for all trials
    tasks: tuple[str, ...] = ()  # the search's; default: the base's, less the held-out
    searched: Amount = 0  # so many of these tasks, drawn by the sweep's seed; 0: all
    held_out: tuple[str, ...] = ()  # tasks that only confirmation sees
    held_out_share: ShareBelowOne = 0.0  # or this share of the base's, drawn by the sweep's seed
    sampler: Literal["tpe", "random", "grid"] = "tpe"
    trials: Count = 40  # the grid: all its points
    batch: Count = 4  # trials asked at once; part of what makes the study
    startup: Amount = 10  # random trials before TPE begins
    enqueued: tuple[dict[str, Value], ...] = ()  # the first trials, in this order; may grow
    base_first: bool = True  # the base's own setting is the first trial, where none is enqueued
    seed: Seed = 0  # of the sampler
    objectives: tuple[str, ...] = ("gain",)  # metrics of one of `sweeps.questions`
    constraints: dict[str, float] = field(default_factory=dict)  # metric → most it may be
    pruner: Pruner = Pruner()
    confirm: Confirm = Confirm()
    tables: tuple[TableSpec, ...] = ()  # of a grid: its points beside No-Stitch

    def __post_init__(self) -> None:
        with settings_of(f"sweep {self.name}"):
            super().__post_init__()
        check_sweep(self)

    @property
    def question(self) -> Question[Any]:
        """What is asked of a setting: whose metrics the objectives are."""
        return question_of(self.objectives, f"sweep {self.name}, objectives")

    @property
    def points(self) -> list[dict[str, int | float | bool | str]]:
        """The grid's, in order; none for other samplers."""
        where = f"sweep {self.name}, space"
        return grid_points(self.space, where) if self.sampler == "grid" else []

    @property
    def extent(self) -> dict[str, str | int]:
        """How much is asked for: see analysis.results."""
        base = base_spec(self)
        return {
            "scale": self.scale,
            "seeds": base.seeds,
            "episodes": base.episodes,
            "trials": self.budget,
        }

    @property
    def budget(self) -> int:
        """Trials in all."""
        return len(self.points) if self.sampler == "grid" else self.trials


def check_sweep(sweep: SweepSpec) -> None:
    """Refuse what could not be carried out; UsageError says what is valid."""
    where = f"sweep {sweep.name}"
    if not sweep.objectives or len(set(sweep.objectives)) < len(sweep.objectives):
        raise UsageError(f"{where}, objectives: name one or more, each once")
    question_of([*sweep.objectives, *sweep.constraints], f"{where}, objectives and constraints")
    if sweep.pruner.rounds > 1 and not METRICS[sweep.objectives[0]].by_episode:
        raise UsageError(f"{where}, pruner: compares scores: make gain or score the objective")
    if sweep.pruner.rounds > 1 and len(sweep.objectives) > 1:
        raise UsageError(f"{where}, pruner: works with one objective; set rounds = 1")
    if sweep.held_out and sweep.held_out_share:
        raise UsageError(f"{where}: give held_out or held_out_share, not both")
    if sweep.tables and sweep.sampler != "grid":
        raise UsageError(f"{where}, tables: only a grid's points make a table")
    if sweep.tables and any(not path.startswith("mb_stitch.") for path in sweep.space):
        raise UsageError(f"{where}, tables: a table compares methods, not models: search mb_stitch")
    base = base_spec(sweep)
    check_space(sweep.space, base, sweep.question.searched, f"{where}, space")
    if sweep.enqueued and sweep.sampler == "grid":
        raise UsageError(f"{where}, enqueued: a grid has its own order")
    check_enqueued(sweep.enqueued, sweep.space, f"{where}, enqueued")
    if sweep.budget < 1:
        raise UsageError(f"{where}, space: a grid without points")
    searched, held_out = split_tasks(sweep, base)
    if not searched:
        raise UsageError(f"{where}: no tasks are left to search on")
    seen = {task[:2] for task in searched}
    if leaks := [task for task in held_out if task[:2] in seen]:
        raise UsageError(
            f"{where}, held_out: {'>'.join(leaks[0])} begins like a task of the search, so that it "
            "would not be new; hold out tasks whose first two skills the search never joins"
        )
    replace(base, tasks=tuple(map(">".join, [*searched, *held_out])), lengths=())
    asked = replace(base, tasks=tuple(map(">".join, searched)), lengths=())
    sweep.question.check(asked, where)
    fresh = sweep.confirm.root_seed not in (None, base.root_seed)
    if used := [seed for seed in sweep.confirm.seeds if seed < base.seeds and not fresh]:
        raise UsageError(
            f"{where}, confirm.seeds: the search itself uses seed {used[0]}; begin with "
            f"{base.seeds}, or set another confirm.root_seed"
        )


def base_spec(sweep: SweepSpec) -> Spec:
    """The run spec that trials change, with the sweep's settings."""
    loaded = load_spec(sweep.base, sweep.scale)
    where = f"sweep {sweep.name}, settings"
    plain = merged(to_plain(loaded), sweep.settings)
    return spec_from_plain(plain | {"methods": sweep.question.methods, "tables": []}, where)


Task = tuple[str, ...]


def split_tasks(sweep: SweepSpec, base: Spec) -> tuple[list[Task], list[Task]]:
    """The search's tasks and the held-out ones.

    A share is drawn by families: tasks with the same first two skills begin with the same
    segments, and so stay together.
    """
    held_out = [tuple(task.split(">")) for task in sweep.held_out]
    tasks = [tuple(task.split(">")) for task in sweep.tasks] or base.all_tasks
    if sweep.held_out_share:
        families = list(dict.fromkeys(task[:2] for task in tasks))
        drawn = stream("held-out tasks", sweep.seed).permutation(len(families))
        count = max(1, round(sweep.held_out_share * len(families)))
        chosen = {families[place] for place in drawn[:count]}
        held_out = [task for task in tasks if task[:2] in chosen]
    searched = [task for task in tasks if task not in set(held_out)]
    if 0 < sweep.searched < len(searched):
        drawn = stream("searched tasks", sweep.seed).permutation(len(searched))
        searched = [searched[place] for place in sorted(drawn[: sweep.searched])]
    return searched, held_out


PACKAGED = resources.files("sweeps").joinpath("specs")


def packaged_sweeps() -> list[str]:
    """Names of the sweeps that come with the code."""
    return toml_names(PACKAGED)


def load_sweep(name_or_file: str, scale: Scale = "paper", trials: int | None = None) -> SweepSpec:
    """A packaged sweep by name, or any TOML file, at one of its scales.

    A base that is a file is looked for beside the sweep's own. Scales are the base's, and need not
    be said again. Raises UsageError listing what is valid.
    """
    content, where = read_toml(name_or_file, PACKAGED, "sweep")
    own = content.get("scales", {})
    if isinstance(own, dict):  # else `at_scale` refuses it
        content["scales"] = {scale: {}} | own
    content = at_scale(content, scale, where)
    if trials is not None:
        content["trials"] = trials
    base, folder = content.get("base"), Path(where).parent
    if where == name_or_file and isinstance(base, str) and (folder / base).is_file():
        content["base"] = str((folder / base).resolve())
    return structure(SweepSpec, content, where)

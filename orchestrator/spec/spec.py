"""What is to be reproduced, as a frozen dataclass read from a TOML file and open to overrides."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass, field, fields
from itertools import permutations
from pathlib import Path
from typing import TYPE_CHECKING, Any, Union

import tyro

from analysis.tables.rows import ROW_RULES
from orchestrator.benchmarks.registry import BENCHMARKS, ENTRIES
from orchestrator.builders.models import LOADERS
from orchestrator.errors import UsageError
from orchestrator.spec.methods import (
    SHARED,
    method_name,
    method_of,
    parse_method,
    settings_with_effect,
)
from orchestrator.spec.structure import (
    Plain,
    merged,
    nested,
    plain_differences,
    settings_of,
    structure,
    to_plain,
)
from orchestrator.spec.tomls import PACKAGED, Scale, based_fields, read_toml
from stitching.bounds import Bounded, Count, Episodes, Few, Seed
from stitching.methods.no_stitch import NO_STITCH
from stitching.methods.protocol import MethodSettings
from stitching.methods.registry import METHODS
from stitching.models.dynamics import DynamicsConfig
from stitching.models.iql import IQLConfig
from stitching.planning.registry import PLANNERS, PlannerChoice
from stitching.registry import PartError, field_name, is_ours, sections
from stitching.rollout import RolloutConfig

NAME = re.compile(r"[A-Za-z0-9][\w.-]*")  # becomes part of paths


@dataclass(frozen=True)
class TableSpec:
    """One table to write from the ledger."""

    id: str
    paper: str  # the number of the paper's table it stands beside
    rows: str = "length"  # how tasks are grouped: length, last_skill, task; variant in a suite
    title: str = ""
    noun: str = "skills"  # what a row label counts
    baseline: str = ""  # gains of all others over this method; default: of the last over all others


if TYPE_CHECKING:
    DataSettings = Any

    class MethodSections(Bounded):
        """A field for the settings of each method: `mb_stitch`, `reach_stitch`."""

else:
    DataSettings = Union[tuple(dict.fromkeys(entry.data for entry in ENTRIES.values()))]  # noqa: UP007
    with_settings = {name: one.settings for name, one in METHODS.items() if fields(one.settings)}
    MethodSections = sections("MethodSections", with_settings)


@dataclass(frozen=True, kw_only=True)
class Spec(MethodSections):
    """A reproduction: tasks × methods × seeds × episodes of one benchmark, and its tables.

    Beside the fields below it has one for the settings of each registered method.
    """

    name: str
    title: str
    benchmark: str
    data: tyro.conf.AvoidSubcommands[DataSettings]  # of the benchmark
    scale: Scale = "paper"
    lengths: tuple[Few, ...] = ()  # all permutations of these many skills
    tasks: tuple[str, ...] = ()  # and these tasks, as "a>b>c"
    step_limits: dict[int, Count] = field(default_factory=dict)  # whole task, by its length
    methods: tuple[str, ...] = ("no-stitch", "mb-stitch")  # e.g. mb-stitch[alpha=1,beta=10]
    seeds: Few = 3  # a seed retrains everything
    episodes: Episodes = 100  # a task, a method and a seed
    root_seed: Seed = 0
    block_episodes: Episodes = 100  # episodes that step together; part of what makes the bytes
    rollout: RolloutConfig = RolloutConfig()
    agent: IQLConfig = IQLConfig()
    dynamics: DynamicsConfig = DynamicsConfig()
    tables: tuple[TableSpec, ...] = ()

    def __post_init__(self) -> None:
        with settings_of(f"spec {self.name}"):
            super().__post_init__()
        check_spec(self)

    @property
    def skill_names(self) -> list[str]:
        return [skill.name for skill in BENCHMARKS[self.benchmark].skills]

    @property
    def all_tasks(self) -> list[tuple[str, ...]]:
        """Every task, in a fixed order and once."""
        drawn = [task for n in self.lengths for task in permutations(self.skill_names, n)]
        named = [tuple(task.split(">")) for task in self.tasks]
        return list(dict.fromkeys(drawn + named))

    @property
    def extent(self) -> dict[str, str | int]:
        """How much is asked for: see analysis.results."""
        return {
            "scale": self.scale,
            "seeds": self.seeds,
            "episodes": self.episodes,
            "tasks": len(self.all_tasks),
        }

    @property
    def step_limit(self) -> int:
        """Episodes are played to the longest limit of their benchmark and cut afterwards."""
        return max(self.step_limits.values())

    def method_settings(self, method: str) -> MethodSettings:
        """The settings of `name` or `name[field=value,…]`; UsageError lists what is valid.

        Fields of fields are joined by dots: mb-stitch[alpha=5,cem.horizon=3].
        """
        if method == SHARED:
            return NO_STITCH.settings()
        name, overrides = parse_method(method)
        section = getattr(self, field_name(name), METHODS[name].settings())
        settings = merged(to_plain(section), nested(overrides))
        return structure(METHODS[name].settings, settings, f"spec {self.name}, method {method}")


for _name in METHODS:
    if field_name(_name) in {*Spec.__annotations__, *vars(Bounded), *vars(Spec)}:
        raise PartError(
            f"method {_name!r}, of {METHODS[_name].settings.__module__}: specs have another field "
            "or property so called"
        )


def check_spec(spec: Spec) -> None:
    """Refuse what could not be carried out, before anything runs; UsageError says what is valid."""
    where = f"spec {spec.name}"
    if spec.benchmark not in BENCHMARKS:
        known = ", ".join(BENCHMARKS)
        raise UsageError(f"{where}: unknown benchmark {spec.benchmark!r}; there are {known}")
    check_names([spec.name, *(table.id for table in spec.tables)], where)
    _check_tasks(spec, where)
    _check_methods(spec, where)
    _check_altered_data(spec, where)
    ids = [table.id for table in spec.tables]
    for table in spec.tables:
        check_rows(table, f"{where}, table {table.id}")
        if table.rows == "variant":
            raise UsageError(
                f"{where}, table {table.id}: rows 'variant' need [[parts]], for a part is a row"
            )
        if ids.count(table.id) > 1:
            raise UsageError(f"{where}: two tables have the id {table.id!r}")
        if table.baseline and table.baseline not in spec.methods:
            raise UsageError(f"{where}, table {table.id}: the baseline is none of its methods")


def check_names(names: Iterable[str], where: str) -> None:
    """Names become part of paths."""
    for name in names:
        if not NAME.fullmatch(name):
            raise UsageError(f"{where}: {name!r} is no name; use letters, digits, '.', '_' and '-'")


def check_rows(table: TableSpec, where: str) -> None:
    """Raises UsageError where tasks cannot be grouped into such rows."""
    if table.rows not in ROW_RULES:
        raise UsageError(f"{where}: no rows {table.rows!r}; there are {', '.join(ROW_RULES)}")


def _check_tasks(spec: Spec, where: str) -> None:
    names = spec.skill_names
    for length in spec.lengths:
        if not 1 <= length <= len(names):
            raise UsageError(
                f"{where}, lengths: no tasks of {length}: {spec.benchmark} has {len(names)} skills"
            )
    if not spec.all_tasks:
        raise UsageError(f"{where}: no tasks; set lengths or tasks")
    for task in spec.all_tasks:
        if unknown := [skill for skill in task if skill not in names]:
            raise UsageError(
                f"{where}, tasks: {spec.benchmark} has no skill {unknown[0]!r}; "
                f"it has {', '.join(names)}"
            )
        if len(task) not in spec.step_limits:
            raise UsageError(
                f"{where}, step_limits: none for tasks of {len(task)} skills; "
                f"add step_limits.{len(task)}"
            )


def _check_methods(spec: Spec, where: str) -> None:
    if not spec.methods:
        raise UsageError(f"{where}: no methods; there are {', '.join(METHODS)}")
    seen: dict[tuple[str, str], str] = {}
    for method in spec.methods:
        settings = spec.method_settings(method)
        same = seen.setdefault((method_name(method), str(settings_with_effect(settings))), method)
        if same != method or spec.methods.count(method) > 1:
            raise UsageError(f"{where}, methods: {same} and {method} are the same method")
        if unknown := [kind for kind in method_of(method).models if kind not in LOADERS]:
            raise UsageError(
                f"{where}, {method}: needs models of an unknown kind, {unknown[0]!r}; there are "
                f"{', '.join(LOADERS)}"
            )
        if "single-policy" in method_of(method).models:
            _check_demonstrated(spec, f"{where}, {method}")
        with settings_of(f"{where}, {method}"):
            settings.check(BENCHMARKS[spec.benchmark], spec.agent)


def _check_altered_data(spec: Spec, where: str) -> None:
    """What `swap` and `corrections` need: rows of one skill each, the robot and objects apart."""
    if not spec.agent.alters:
        return
    if not BENCHMARKS[spec.benchmark].factors.objects:
        raise UsageError(
            f"{where}, agent: what {spec.benchmark} shows does not tell its robot from objects, "
            "which swap and corrections need"
        )
    if not spec.agent.multi_task:
        raise UsageError(f"{where}, agent: swap and corrections need agent.multi_task")


def _check_demonstrated(spec: Spec, where: str) -> None:
    """Whether there can be demonstrations of a long task that nobody cut."""
    if not ENTRIES[spec.benchmark].long_horizon(spec.data):
        raise UsageError(f"{where}: these data of {spec.benchmark} demonstrate no long task")


def load_spec(name_or_file: str, scale: Scale = "paper") -> Spec:
    """A packaged spec by name, or any TOML file, at one of its scales.

    Raises UsageError for an unknown name, field, scale or value, listing what is valid.
    """
    content, where = read_toml(name_or_file, PACKAGED, "spec")
    _refuse_suite(content, where)
    folder = Path(name_or_file).parent
    return spec_from_plain(based_fields(content, scale, PACKAGED, folder, where), where)


def spec_from_plain(content: Plain, where: str) -> Spec:
    """A spec from parsed TOML or from a run directory's spec.json."""
    _refuse_suite(content, where)
    benchmark = content.get("benchmark")
    if not isinstance(benchmark, str) or benchmark not in BENCHMARKS:
        raise UsageError(
            f"{where}: unknown benchmark {benchmark!r}; there are {', '.join(BENCHMARKS)}"
        )
    data = structure(ENTRIES[benchmark].data, content.get("data", {}), f"{where}, data")
    return structure(Spec, content | {"data": data}, where)


def _refuse_suite(content: Plain, where: str) -> None:
    if "parts" in content:
        raise UsageError(
            f"{where}: a suite of several runs; here goes one, such as one of its parts"
        )


def plain_spec(spec: Spec) -> Plain:
    """A spec as files keep it, which can be read without packages whose parts it does not use."""
    plain: Plain = to_plain(spec)
    used = {method_name(method) for method in spec.methods}
    for name in METHODS.keys() - used:
        if not is_ours(METHODS[name].settings):
            plain.pop(field_name(name), None)
    every = (spec.method_settings(method) for method in spec.methods)
    chosen = {one.planner for one in every if isinstance(one, PlannerChoice)}
    unused = [name for name in PLANNERS.keys() - chosen if not is_ours(PLANNERS[name])]
    planning = [one for one in plain.values() if isinstance(one, dict) and "planner" in one]
    for section in planning:
        for name in unused:
            if section["planner"] != name:
                section.pop(field_name(name))
    return plain


def differences(old: Spec, new: Spec) -> list[str]:
    """Human-readable list of the fields in which two specs differ."""
    return plain_differences(to_plain(old), to_plain(new))

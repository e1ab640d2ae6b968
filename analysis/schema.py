"""What a run directory holds: its files and their columns, and the description of what was asked.

The one place that names them: the orchestrator writes by it, and reports read by it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

SEPARATOR = ">"
"""Joins the skills of a task or prefix: "g0>g1"."""

VARIANT = "@"
"""Joins a method and what it was trained on: "mb-stitch@level-1" (Table 5)."""


# The files of a run directory that reports are made from.
SPEC = "spec.json"  # what was asked: `RunSpec`
PROVENANCE = "provenance.json"  # versions, revision, machine, times
SEGMENTS = "segments.parquet"  # a row for each segment: see EPISODE_COLUMNS
EPISODES = "episodes.parquet"  # a row for each episode of a task: `analysis.episodes`
QUARANTINE = "quarantine.json"  # blocks that failed three times
TRAINING = "training.json"  # learning curves
DATASETS = "datasets.json"  # rows, episodes and digest of each dataset
SHOWCASE = "showcase.json"  # a task step by step
DIAGNOSIS = "diagnosis.json"  # models judged on held-out data
STITCHES = "stitches.json"  # the study of stitches

WRITTEN = (
    PROVENANCE, SEGMENTS, EPISODES, QUARANTINE, TRAINING, DATASETS, SHOWCASE, DIAGNOSIS, STITCHES,
)  # fmt: skip
"""Those that are written when all is played, from what was played: they can be written again."""

EPISODE_COLUMNS = {
    "episode": "int64",
    "success": "bool",
    "stitch_steps": "int64",
    "steps": "int64",  # stitching included
    "end_step": "int64",  # of the whole task so far
    "value_start": "float32",  # of the segment's skill, before its stitch
    "value_end": "float32",  # and after it
}
"""What happened in a segment → type, after the columns that say which one it is: seed, method (""
for first skills that methods share), prefix (skills up to this one) and depth (how many they are).
"""


class RunError(ValueError):
    """A run directory that cannot be reported on; the message says what to do."""


@dataclass(frozen=True)
class TableEntry:
    """One table a run is to be shown as."""

    id: str
    paper: str  # the paper's number of this table; "" if it has none
    rows: str  # a name in analysis.tables.rows.ROW_RULES
    title: str
    noun: str = "skills"  # of row labels such as "2 goals"
    baseline: str = ""  # gains of all others over this method; default: last over all others


@dataclass(frozen=True)
class PartEntry:
    """One of several runs that were merged: who played what there, and when it was cut."""

    label: str
    methods: tuple[str, ...]
    tasks: tuple[str, ...]
    step_limits: Mapping[int, int]
    block_episodes: int


@dataclass(frozen=True)
class Origin:
    """How what was asked stands to the packaged file and to the defaults."""

    packaged: str = ""  # the packaged file that has this name and scale; "" if none has
    command: tuple[str, ...] = ()  # asks for the same again; () where no options do
    changed: tuple[tuple[str, Any, Any], ...] = ()  # field, here, in the packaged file
    defaults: tuple[tuple[str, Any, Any], ...] = ()  # field, here, its default


@dataclass(frozen=True)
class RunSpec:
    """What was asked of a run: the part of `spec.json` that its tables depend on."""

    name: str
    title: str
    benchmark: str
    scale: str
    skills: tuple[str, ...]
    methods: Mapping[str, str]  # name -> label, in the order of the columns
    seeds: tuple[int, ...]
    episodes: int  # per task, method and seed
    tasks: tuple[str, ...]
    step_limits: Mapping[int, int]  # task length -> steps of a whole task
    tables: tuple[TableEntry, ...]
    skill_labels: Mapping[str, str] = field(default_factory=dict)
    own_first_skill: frozenset[str] = frozenset()  # methods whose first skill nobody shares
    block_episodes: int = 1  # episodes that are played, and lost, together
    parts: tuple[PartEntry, ...] = ()  # the runs that this one was merged from, if it was
    models: Mapping[str, tuple[str, ...]] = field(default_factory=dict)  # kinds, by method
    long_task: str = ""  # what Single-Policy learned, uncut; "" of a merged run
    settings: Mapping[str, object] = field(default_factory=dict)  # all that was asked, by path
    origin: Origin | None = None  # None: an earlier version asked

    @classmethod
    def from_dict(cls, spec: Mapping[str, Any]) -> RunSpec:
        """Reads the resolved spec; keys that no table depends on are left alone."""
        try:
            return cls(
                name=spec["name"],
                title=spec.get("title", spec["name"]),
                benchmark=spec["benchmark"],
                scale=spec["scale"],
                skills=tuple(spec["skills"]),
                methods={m["name"]: m.get("label", m["name"]) for m in spec["methods"]},
                seeds=tuple(spec["seeds"]),
                episodes=spec["episodes"],
                tasks=tuple(spec["tasks"]),
                step_limits=_step_limits(spec),
                tables=tuple(_table_entry(entry) for entry in spec["tables"]),
                skill_labels=spec.get("skill_labels", {}),
                own_first_skill=frozenset(
                    m["name"] for m in spec["methods"] if m.get("own_first_skill", False)
                ),
                models={m["name"]: tuple(m["models"]) for m in spec["methods"] if "models" in m},
                block_episodes=spec.get("spec", {}).get("block_episodes", 1),
                long_task=spec.get("spec", {}).get("single_policy", {}).get("task", ""),
                settings=_settings(spec.get("spec", {})),
                origin=_origin(spec["origin"]) if "origin" in spec else None,
                parts=tuple(
                    PartEntry(
                        part["label"],
                        tuple(part["methods"]),
                        tuple(part["tasks"]),
                        _step_limits(part),
                        part["block_episodes"],
                    )
                    for part in spec.get("parts", ())
                ),
            )
        except KeyError as missing:
            raise RunError(f"spec.json has no {missing}: another version wrote it") from None

    @property
    def extent(self) -> dict[str, str | int]:
        """How much was asked for: see analysis.results."""
        return {
            "scale": self.scale,
            "seeds": len(self.seeds),
            "episodes": self.episodes,
            "tasks": len(self.tasks),
        }

    @property
    def by_part(self) -> list[RunSpec]:
        """The spec of each part alone; this one if it has none."""
        return [
            replace(
                self,
                methods={name: self.methods[name] for name in part.methods if name in self.methods},
                tasks=tuple(task for task in part.tasks if task in self.tasks),
                step_limits=part.step_limits,
                block_episodes=part.block_episodes,
                parts=(),
            )
            for part in self.parts
        ] or [self]

    @property
    def sharing_first_skills(self) -> list[str]:
        """Labels of the methods whose first skills are the same episodes, under method ""."""
        return [label for name, label in self.methods.items() if name not in self.own_first_skill]

    def skill_label(self, skill: str) -> str:
        """The name a skill goes by in tables: "bottom-burner" -> "bottom burner"."""
        return self.skill_labels.get(skill) or plain_label(skill)

    def task_label(self, task: str) -> str:
        """The name a task goes by in tables: "g0>g1" -> "g0 → g1"."""
        return " → ".join(self.skill_label(skill) for skill in task.split(SEPARATOR))


def leaves(plain: Mapping[str, Any], separator: str) -> dict[str, Any]:
    """Nested dicts as one, their keys joined."""
    flat: dict[str, Any] = {}
    for name, value in plain.items():
        if isinstance(value, dict):
            below = leaves(value, separator).items()
            flat |= {f"{name}{separator}{key}": leaf for key, leaf in below}
        else:
            flat[name] = value
    return flat


def _settings(asked: Mapping[str, Any]) -> dict[str, Any]:
    """All that was asked, by path; parts by their labels, and tables by their ids."""
    named = {
        name: {part[key]: part for part in asked[name]}
        for name, key in (("parts", "label"), ("tables", "id"))
        if name in asked
    }
    return leaves({**asked, **named}, ".")


def _origin(plain: Mapping[str, Any]) -> Origin:
    return Origin(
        plain["packaged"],
        tuple(plain["command"]),
        *(tuple((at, a, b) for at, a, b in plain[name]) for name in ("changed", "defaults")),
    )


def _step_limits(plain: Mapping[str, Any]) -> dict[int, int]:
    return {int(length): limit for length, limit in plain["step_limits"].items()}


def _table_entry(entry: Mapping[str, Any]) -> TableEntry:
    known = TableEntry.__dataclass_fields__
    return TableEntry(**{name: value for name, value in entry.items() if name in known})


def plain_label(skill: str) -> str:
    """A skill's name as people write it: "bottom-burner" → "bottom burner"."""
    return skill.replace("_", " ").replace("-", " ")


def task_length(task: str) -> int:
    """How many skills a task has."""
    return task.count(SEPARATOR) + 1


def kind_of(showcase: Mapping[str, Any]) -> str:
    """How a recording is drawn; those of earlier versions do not say it."""
    return str(showcase.get("kind", "map" if "layout" in showcase else "physics"))

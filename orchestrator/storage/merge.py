"""The readable files of a suite, from those of its parts: a pure function of them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import pandas as pd

from analysis.schema import (
    DATASETS,
    DIAGNOSIS,
    PROVENANCE,
    QUARANTINE,
    SEGMENTS,
    SEPARATOR,
    SHOWCASE,
    STITCHES,
    TRAINING,
    VARIANT,
    kind_of,
    plain_label,
)
from orchestrator.benchmarks.registry import ENTRIES
from orchestrator.errors import UsageError
from orchestrator.spec.methods import first_method, method_label, method_of
from orchestrator.spec.origin import origin
from orchestrator.spec.structure import Plain, to_plain
from orchestrator.spec.suite import Part, Suite, suite_of
from orchestrator.storage.claim import IDENTITY
from orchestrator.storage.rundir import RunDirectory

SUMMED = ("counts", "seconds", "busy worker seconds")  # of the parts' provenance
KEPT = ("run_id", "written", "git_revision", "cpu", "executor", "workers", *SUMMED)


@dataclass(frozen=True)
class Naming:
    """What a part's methods and skills are called where all parts meet.

    Where rows are variants every part's methods are methods of their own, first skills included.
    Elsewhere methods are the same in all parts and tasks are not; skills that parts share by name
    are told apart by the part's label, which no table shows.
    """

    suite: Suite
    part: Part

    def method(self, method: str) -> str:
        return f"{method}{VARIANT}{self.part.label}" if self.suite.by_variant else method

    def label(self, method: str) -> str:
        named = method_label(method)
        return f"{named} {VARIANT} {self.part.label}" if self.suite.by_variant else named

    def skill(self, skill: str) -> str:
        return f"{self.part.label}:{skill}" if self.suite.tells_skills_apart else skill

    def prefix(self, prefix: str) -> str:
        return SEPARATOR.join(map(self.skill, prefix.split(SEPARATOR)))

    def played_by(self, method: str) -> list[str]:
        """The merged methods of a part's segment or block; "" is all that share first skills."""
        if method:
            return [self.method(method)]
        spec = self.part.spec
        shared = [m for m in spec.methods if not first_method(m, spec.rollout)]
        if self.suite.by_variant:
            return [self.method(m) for m in shared]
        # What has first skills of its own in another part cannot share them here.
        return ["", *(m for m in shared if has_own_first_skill(self.suite, m))]


def has_own_first_skill(suite: Suite, method: str) -> bool:
    """Whether a method, as parts call it, has first skills that it shares with no other."""
    return suite.by_variant or any(
        method in part.spec.methods and first_method(method, part.spec.rollout)
        for part in suite.parts
    )


def describe_suite(suite: Suite) -> Plain:
    """spec.json of a suite, as `claim.describe` writes a run's."""
    parts = [_describe_part(suite, part) for part in suite.parts]
    specs = [part.spec for part in suite.parts]
    limits: dict[str, int] = {}
    for part in parts:
        for length, limit in part["step_limits"].items():
            limits[length] = max(limit, limits.get(length, 0))  # each part is cut at its own
    return {
        "name": suite.name,
        "title": suite.title,
        "benchmark": " and ".join(dict.fromkeys(spec.benchmark for spec in specs)),
        "scale": suite.scale,
        "skills": list(dict.fromkeys(skill for part in parts for skill in part["skills"])),
        "skill_labels": {name: shown for part in parts for name, shown in part["skill_labels"]},
        "methods": list(
            {
                (name := Naming(suite, part).method(method)): {
                    "name": name,
                    "label": Naming(suite, part).label(method),
                    "own_first_skill": has_own_first_skill(suite, method),
                    "models": list(method_of(method).models),
                }
                for part in suite.parts
                for method in part.spec.methods
            }.values()
        ),
        "seeds": list(range(specs[0].seeds)),
        "episodes": specs[0].episodes,
        "tasks": list(dict.fromkeys(task for part in parts for task in part["tasks"])),
        "step_limits": limits,
        "tables": [to_plain(table) | {"title": _title(suite, table)} for table in suite.tables],
        "parts": [
            {
                name: part[name]
                for name in ("label", "methods", "tasks", "step_limits", "block_episodes")
            }
            for part in parts
        ],
        "spec": to_plain(suite),
        "origin": origin(suite),
    }


def _describe_part(suite: Suite, part: Part) -> Plain:
    naming, spec = Naming(suite, part), part.spec
    skills = spec.skill_names
    return {
        "label": part.label,
        "methods": [naming.method(method) for method in spec.methods],
        "tasks": [naming.prefix(SEPARATOR.join(task)) for task in spec.all_tasks],
        "step_limits": {str(length): limit for length, limit in spec.step_limits.items()},
        "block_episodes": spec.block_episodes,
        "skills": [naming.skill(skill) for skill in skills],
        "skill_labels": [
            (naming.skill(skill), suite.skill_label(skill))
            for skill in skills
            if suite.skill_label(skill) != plain_label(naming.skill(skill))
        ],
    }


def _title(suite: Suite, table: Any) -> str:
    """A table's title, which names unusual data as a run's does, unless its rows do."""
    title = table.title or suite.title
    data = {part.label: ENTRIES[part.spec.benchmark].label(part.spec.data) for part in suite.parts}
    if len(set(data.values())) == 1:
        unusual = next(iter(data.values()))
    else:
        unusual = "; ".join(f"{label}: {text}" for label, text in data.items() if text)
        unusual = "" if suite.by_variant else unusual
    return f"{title} ({unusual})" if unusual else title


def write_merged(suite: Suite, directory: RunDirectory, run_id: str) -> None:
    """Write every readable file but the report; what a part has not played yet is left out.

    UsageError where no part has played anything.
    """
    there = {
        part.label: directory.part(part.label)
        for part in suite.parts
        if (directory.part(part.label).path / SEGMENTS).is_file()
    }
    if not there:
        raise UsageError(f"{directory.path}: no part has a segments.parquet yet; run the suite")
    named = {part.label: Naming(suite, part) for part in suite.parts}
    segments = [_segments(there[label], named[label]) for label in there]
    merged = pd.concat(segments, ignore_index=True)
    merged.to_parquet(directory.path / SEGMENTS, index=False)

    def gathered(name: str, renamed: Callable[[Plain, Naming], Iterator[Plain]]) -> list[Plain]:
        return [
            entry
            for label, part in there.items()
            for plain in part.read_json(name) or []
            for entry in renamed(plain, named[label])
        ]

    directory.write_json(QUARANTINE, gathered(QUARANTINE, _given_up))
    directory.write_json(TRAINING, gathered(TRAINING, _trained))
    directory.write_json(DATASETS, gathered(DATASETS, _dataset))
    for name, of_part in {
        STITCHES: stitches_of_part,
        DIAGNOSIS: diagnosis_of_part,
        SHOWCASE: showcase_of_part,
    }.items():
        found = {label: part.read_json(name) for label, part in there.items()}
        parts = {label: of_part(one, named[label]) for label, one in found.items() if one}
        if parts:
            directory.write_json(name, {"parts": parts})
    made = {label: part.read_json(PROVENANCE) for label, part in there.items()}
    directory.write_json(PROVENANCE, _provenance(made) | {"run_id": run_id})


def merge_again(directory: RunDirectory) -> None:
    """Write a suite's files from what its parts have now. UsageError where nothing was played."""
    identity = directory.read_json(IDENTITY)
    write_merged(suite_of(directory), directory, identity["run_id"])


def _segments(part: RunDirectory, naming: Naming) -> pd.DataFrame:
    frame = pd.read_parquet(part.path / SEGMENTS)
    frame["prefix"] = frame["prefix"].map({p: naming.prefix(p) for p in frame["prefix"].unique()})
    copies = [
        rows.assign(method=name)
        for method, rows in frame.groupby("method", sort=False)
        for name in naming.played_by(str(method))
    ]
    return pd.concat(copies) if copies else frame


def _given_up(block: Plain, naming: Naming) -> Iterator[Plain]:
    for method in naming.played_by(block["method"]):
        yield block | {"method": method, "prefix": naming.prefix(block["prefix"])}


def _trained(model: Plain, naming: Naming) -> Iterator[Plain]:
    label = naming.part.label
    yield model | {"name": f"{label}: {model['name']}", "part": label}


def _dataset(dataset: Plain, naming: Naming) -> Iterator[Plain]:
    """Without what is told by skills' names, which hold for one part alone."""
    kept = {name: value for name, value in dataset.items() if name not in ("orders", "skills")}
    yield kept | {"name": f"{naming.part.label}: {dataset['name']}"}


def stitches_of_part(study: Plain, naming: Naming) -> Plain:
    """Stitches of a part, between skills as they are called where all parts meet."""

    def renamed(entry: Plain) -> Plain:
        first, second = entry["first"], entry["second"]  # nothing comes before a first skill
        return entry | {
            "first": naming.skill(first) if first else first,
            "second": naming.skill(second),
        }

    typical = study["typical_distance"].items()
    return study | {
        "pairs": [renamed(pair) for pair in study["pairs"]],
        "stitches": [renamed(stitch) for stitch in study["stitches"]],
        "typical_distance": {naming.skill(skill): distance for skill, distance in typical},
    }


def diagnosis_of_part(study: Plain, naming: Naming) -> Plain:
    """What is known of a part's models, of skills as they are called where all parts meet.

    Parts that were diagnosed by an earlier version lack what it did not measure.
    """
    renamed: Plain = {
        name: {naming.skill(skill): found for skill, found in study[name].items()}
        for name in ("values", "prices", "competence")
        if name in study
    }
    if "forecast" in study:
        renamed["forecast"] = [
            pair | {place: naming.skill(pair[place]) for place in ("first", "second")}
            for pair in study["forecast"]
        ]
    return study | renamed


def showcase_of_part(showcase: Plain, naming: Naming) -> Plain:
    """What a part shows, under the names of the whole; a maze's has its goals' own on its map."""
    renamed = showcase | {
        "episodes": [e | {"method": naming.method(e["method"])} for e in showcase["episodes"]]
    }
    if kind_of(showcase) != "physics":
        return renamed
    for episode in renamed["episodes"]:
        episode["skill"] = [naming.skill(skill) for skill in episode["skill"]]
    counts = showcase["accomplished_by_all"].items()
    return renamed | {
        "task": naming.prefix(showcase["task"]),
        "accomplished_by_all": {naming.method(method): each for method, each in counts},
    }


def _provenance(made: dict[str, Plain]) -> Plain:
    """Of the part written last, all parts' numbers summed, and what each part was made with."""
    last = max(made.values(), key=lambda of_part: of_part["written"])
    whole = {name: value for name, value in last.items() if name not in ("executor", "workers")}
    for name in SUMMED:
        total: Counter[str] = Counter()
        for of_part in made.values():
            total.update(of_part.get(name, {}))
        whole[name] = {what: round(number, 1) for what, number in total.items()}
    whole["parts"] = {
        label: {name: of_part[name] for name in KEPT if name in of_part}
        for label, of_part in made.items()
    }
    return whole

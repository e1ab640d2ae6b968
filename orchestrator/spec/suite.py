"""One table made of several runs that differ in data, benchmark or any other field."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from analysis.schema import SPEC, plain_label
from orchestrator.errors import UsageError
from orchestrator.spec.spec import (
    Spec,
    TableSpec,
    check_names,
    check_rows,
    differences,
    spec_from_plain,
)
from orchestrator.spec.structure import Plain, merged, plain_differences, structure, to_plain
from orchestrator.spec.tomls import PACKAGED, Scale, based_fields, check_scales, read_toml
from orchestrator.storage.rundir import RunDirectory

OWN_FIELDS = ("name", "title", "parts", "tables", "skill_labels")  # all others are the parts'
NOT_OF_A_PART = ("name", "title", "scale", "tables")


@dataclass(frozen=True)
class PartFields:
    """One of a suite's `[[parts]]` as a file has it."""

    label: str  # its row where rows are variants, and the name of its folder
    base: str = ""  # another spec, by name or file; empty: the suite's own fields alone
    settings: dict[str, Any] = field(default_factory=dict)  # over the base's fields
    scales: dict[str, dict[str, Any]] = field(default_factory=dict)  # over these, by scale


@dataclass(frozen=True)
class Part:
    """One of a suite's runs, and what it is called there."""

    label: str
    spec: Spec


@dataclass(frozen=True)
class Suite:
    """Runs to be carried out one after the other, and the tables over all of them."""

    name: str
    title: str
    scale: Scale
    parts: tuple[Part, ...]
    tables: tuple[TableSpec, ...]
    skill_labels: dict[str, str] = field(default_factory=dict)  # skill → its name in the tables

    def __post_init__(self) -> None:
        check_suite(self)

    @property
    def extent(self) -> dict[str, str | int]:
        """How much is asked for: see analysis.results."""
        specs = [part.spec for part in self.parts]
        return {
            "scale": self.scale,
            "seeds": max(spec.seeds for spec in specs),
            "episodes": max(spec.episodes for spec in specs),
        }

    @property
    def by_variant(self) -> bool:
        """Whether a row is a part: then each part's methods are methods of their own."""
        return any(table.rows == "variant" for table in self.tables)

    @property
    def tells_skills_apart(self) -> bool:
        """Whether a skill's name does not say whose it is: parts share one, and their methods."""
        played = Counter(
            skill
            for part in self.parts
            for skill in {skill for task in part.spec.all_tasks for skill in task}
        )
        return not self.by_variant and any(parts > 1 for parts in played.values())

    def skill_label(self, skill: str) -> str:
        return self.skill_labels.get(skill) or plain_label(skill)


def check_suite(suite: Suite) -> None:
    """Refuse what could not be put into one table; UsageError says what to do."""
    where = f"suite {suite.name}"
    labels = [part.label for part in suite.parts]
    ids = [table.id for table in suite.tables]
    check_names([suite.name, *labels, *ids], where)
    for what, names in (("parts", labels), ("tables", ids)):
        if not names:
            raise UsageError(f"{where}: no {what}; add [[{what}]]")
        if len(set(names)) < len(names):
            raise UsageError(f"{where}: two {what} of one name; there are {', '.join(names)}")
    for name in ("seeds", "episodes"):
        values = {part.label: getattr(part.spec, name) for part in suite.parts}
        if len(set(values.values())) > 1:
            raise UsageError(
                f"{where}: the rows of a table need equally many {name}, parts have {values}; "
                f"set {name} in the suite's file, or give --{name}"
            )
    for table in suite.tables:
        _check_table(suite, table, f"{where}, table {table.id}")


def _check_table(suite: Suite, table: TableSpec, where: str) -> None:
    check_rows(table, where)
    if suite.by_variant and table.rows != "variant":
        raise UsageError(
            f"{where}: rows {table.rows!r} beside another table's rows 'variant', where each "
            "part's methods are methods of their own; make it a suite of its own"
        )
    if table.baseline and not any(table.baseline in part.spec.methods for part in suite.parts):
        raise UsageError(f"{where}: the baseline {table.baseline!r} is no part's method")
    if table.rows != "variant":
        rows = Counter(
            " → ".join(map(suite.skill_label, task))
            for part in suite.parts
            for task in part.spec.all_tasks
        )
        if twice := [row for row, parts in rows.items() if parts > 1]:
            raise UsageError(
                f"{where}: two parts play {twice[0]!r}, which would be counted as one; use "
                'rows = "variant", where a part is a row'
            )


def load_asked(name_or_file: str, scale: Scale = "paper") -> Spec | Suite:
    """A packaged spec or suite by name, or any TOML file, at a scale.

    Raises UsageError for whatever is unknown or missing, listing what is valid.
    """
    content, where = read_toml(name_or_file, PACKAGED, "spec")
    folder = Path(name_or_file).parent
    if "parts" not in content:
        return spec_from_plain(based_fields(content, scale, PACKAGED, folder, where), where)
    if not isinstance(content["parts"], list):
        raise UsageError(f"{where}, parts: expected [[parts]], got {content['parts']!r}")
    if missing := [name for name in ("name", "title", "tables") if name not in content]:
        raise UsageError(f"{where}: field {missing[0]!r} is missing")
    entries = [
        structure(PartFields, entry, f"{where}, parts[{i}]")
        for i, entry in enumerate(content["parts"])
    ]
    for number, entry in enumerate(entries):
        check_names([entry.label], f"{where}, parts[{number}], label")
        if not entry.base and "benchmark" not in {**content, **entry.settings}:
            raise UsageError(
                f"{where}, part {entry.label}: neither base nor benchmark; name a spec as its base"
            )
    parts = tuple(
        Part(entry.label, _part_spec(entry, content, scale, folder, where)) for entry in entries
    )
    own = {name: content[name] for name in OWN_FIELDS if name in content}
    return structure(Suite, own | {"scale": scale, "parts": parts}, where)


def _part_spec(entry: PartFields, content: Plain, scale: Scale, folder: Path, where: str) -> Spec:
    """The base's fields, over them those of the suite's file, over them the part's settings.

    Of the part's settings those of the scale come last.
    """
    where = f"{where}, part {entry.label}"
    check_scales(entry.scales, where)
    settings = merged(entry.settings, entry.scales.get(scale, {}))
    if foreign := [name for name in NOT_OF_A_PART if name in settings]:
        raise UsageError(f"{where}, settings: {foreign[0]!r} is the suite's; set it there")
    shared = {name: value for name, value in content.items() if name not in OWN_FIELDS}
    shared["base"] = entry.base
    fields = based_fields(shared, scale, PACKAGED, folder, where)
    fields = merged(fields, settings)
    fields |= {"name": f"{content['name']}-{entry.label}"}
    fields |= {"title": f"{content['title']}: {entry.label}"}
    return spec_from_plain(fields, where)


def with_specs(suite: Suite, specs: list[Spec]) -> Suite:
    """The suite with other specs for its parts, in their order."""
    parts = zip(suite.parts, specs, strict=True)
    return replace(suite, parts=tuple(replace(part, spec=spec) for part, spec in parts))


def suite_of(directory: RunDirectory) -> Suite:
    """The suite a directory was made for. UsageError where it was made for a run."""
    plain, where = directory.asked()["spec"], str(directory.path / SPEC)
    if "parts" not in plain:
        raise UsageError(f"{directory.path} holds a run and no suite; choose another --out")
    parts = tuple(
        Part(part["label"], spec_from_plain(part["spec"], f"{where}, part {part['label']}"))
        for part in plain["parts"]
    )
    return structure(Suite, plain | {"parts": parts}, where)


def suite_differences(old: Suite, new: Suite) -> list[str]:
    """A line for each field in which two suites differ, named by its part."""
    before, now = ({part.label: part.spec for part in suite.parts} for suite in (old, new))
    if list(before) != list(now):
        return [f"parts: {list(before)} → {list(now)}"]
    lines = [
        f"part {label}, {line}" for label in now for line in differences(before[label], now[label])
    ]
    was, is_now = ({**to_plain(suite), "parts": None} for suite in (old, new))
    return plain_differences(was, is_now) + lines

"""What a report of a sweep tells, section by section, as Markdown."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from analysis.figures.drawn import Drawn
from analysis.schema import leaves
from analysis.tables.writers import markdown_table
from orchestrator.spec.structure import Plain, to_plain
from sweeps.confirm import confirm_spec
from sweeps.search import search_spec
from sweeps.space import Dimension, Fields, current, short
from sweeps.spec import SweepSpec, base_spec, split_tasks

HISTORY = "History"


@dataclass(frozen=True)
class Section:
    """One part of a report; left out where it has neither text nor figures."""

    title: str
    lines: tuple[str, ...] = ()
    figures: tuple[Drawn, ...] = ()
    on_page_only: bool = False  # long, or of this machine and day: not kept with the code


@dataclass(frozen=True)
class Found:
    """All that a report is made from."""

    sweep: SweepSpec
    trials: Sequence[Plain]  # as in trials.json
    ranked: Sequence[Plain]  # those that could be the winner, best first
    confirmed: Plain  # confirm.json, or {}
    importances: Mapping[str, float]
    counts: Plain  # counts.json
    provenance: Plain
    command: str  # that makes the sweep again
    files: Sequence[str]  # beside the report


def sections(found: Found, figures: Sequence[Drawn]) -> list[Section]:
    """All that there is something to say in, in their order."""
    drawn = {figure.name: figure for figure in figures}

    def named(*names: str) -> tuple[Drawn, ...]:
        return tuple(drawn[name] for name in names if name in drawn)

    sweep, winner = found.sweep, found.ranked[0]
    several = len(sweep.objectives) > 1
    told = tuple(sweep.question.trial_lines(sweep.objectives, found.ranked))
    every = [
        Section("The search", (_head(sweep, found.trials),)),
        Section("Winner", _winner(sweep, winner, found.confirmed)),
        Section("Pareto front" if several else "Best trials in the search", told, named("pareto")),
        Section(HISTORY, figures=named("history")),
        Section("Importances", _importances(found.importances), named("importances")),
        Section("Slices", figures=named("slices")),
        Section("α × β", figures=named("alpha-beta", "alpha-beta-tasks")),
        Section("All trials", _every_trial(sweep, found.trials), on_page_only=True),
        Section("Search space", _space(sweep, winner["fields"])),
        Section("How it was searched", _how(sweep)),
        Section("What it took", _costs(found.counts), on_page_only=True),
        Section("Made again by", _again(sweep, found.command, found.files)),
        Section("All settings of the base", _base(sweep), on_page_only=True),
        Section("Provenance", _facts(leaves(found.provenance, ".")), on_page_only=True),
    ]
    return [section for section in every if section.lines or section.figures]


def _head(sweep: SweepSpec, trials: Sequence[Plain]) -> str:
    """What was searched, and how."""
    spec = search_spec(sweep)
    given_up = sum(trial["pruned"] for trial in trials)
    of = "" if len(trials) >= sweep.budget else f" of {sweep.budget}, the others are not finished"
    seeds = f"{spec.seeds} seed{'s' if spec.seeds > 1 else ''}"
    return (
        f"Sweep `{sweep.name}` at {sweep.scale} scale over `{Path(sweep.base).stem}`: "
        f"{len(trials)} trials{of} ({sweep.sampler}, {given_up} given up early), each on "
        f"{len(spec.tasks)} tasks × {seeds} × {spec.episodes} episodes. "
        f"{sweep.question.note} {sweep.question.seeds_note(spec.seeds)}"
    )


def _winner(sweep: SweepSpec, best: Plain, confirmed: Plain) -> tuple[str, ...]:
    """The winner, and what is left of it where the search has never been."""
    question = sweep.question
    found = f"Trial {best['trial']}: {best['setting']}. In the search: {question.headline(best)}."
    if not confirmed:
        return (
            found,
            "",
            f"It was not judged again: its {question.main} is that of the best of many, and so too "
            "good. Set `confirm` to learn how much of it survives.",
        )
    spec, seeds = confirm_spec(sweep)
    where = "held-out tasks" if confirmed["held_out"] else "tasks of the search"
    numbers = ", ".join(map(str, seeds))
    return (
        found,
        "",
        f"Judged again on {len(spec.tasks)} {where} by new seeds ({numbers}; root seed "
        f"{spec.root_seed}), {spec.episodes} episodes each. {question.seeds_note(len(seeds))}",
        "",
        *question.confirmed_lines(confirmed),
    )


def _importances(importances: Mapping[str, float]) -> tuple[str, ...]:
    """How much each searched field matters; nothing where that is not known."""
    shares = ", ".join(f"`{path}` {share:.2f}" for path, share in importances.items())
    return (f"PED-ANOVA: {shares}.",) if shares else ()


def _every_trial(sweep: SweepSpec, trials: Sequence[Plain]) -> tuple[str, ...]:
    header = ["Trial", "Setting", sweep.question.main.capitalize(), "Ended"]
    rows = [
        [str(trial["trial"]), trial["setting"], sweep.question.headline(trial), _end(trial)]
        for trial in trials
    ]
    return (markdown_table(header, rows),)


def _end(trial: Plain) -> str:
    if trial["pruned"]:
        return f"given up after round {trial['rounds']}"
    return "whole" if trial["feasible"] else "whole, against the constraints"


def _space(sweep: SweepSpec, winner: Fields) -> tuple[str, ...]:
    """Every searched field: its values, the base's own and the winner's."""
    base = base_spec(sweep)
    rows = []
    for path, dimension in sweep.space.items():
        own = current(base, path)
        own_text = "–" if own is None else short(own)
        rows.append([f"`{path}`", *_values(sweep, dimension), own_text, short(winner[path])])
    return (markdown_table(["Field", "Values", "Scale", "The base's own", "Winner's"], rows),)


def _values(sweep: SweepSpec, dimension: Dimension) -> tuple[str, str]:
    if dimension.choices:
        return ", ".join(map(short, dimension.choices)), "choices"
    low, high = dimension.ends
    kind = "whole numbers, " if dimension.integer else ""
    points = f", {dimension.points} points" if sweep.sampler == "grid" else ""
    scale = "logarithmic" if dimension.log else "linear"
    return f"{short(low)} to {short(high)}", f"{kind}{scale}{points}"


def _how(sweep: SweepSpec) -> tuple[str, ...]:
    """All that makes the study, but for the space."""
    base = base_spec(sweep)
    searched, held_out = split_tasks(sweep, base)
    asked = to_plain(sweep)
    facts = {
        "base": Path(sweep.base).name,
        **{f"base, {path}": value for path, value in sorted(leaves(sweep.settings, ".").items())},
        **{name: asked[name] for name in ("sampler", "seed", "batch")},
        "trials": sweep.budget,
        **({"startup": sweep.startup} if sweep.sampler == "tpe" else {}),
        "enqueued": len(sweep.enqueued),
        "objectives": sweep.objectives,
        **{f"most of {metric}": most for metric, most in sorted(sweep.constraints.items())},
        **{f"pruner, {name}": value for name, value in asked["pruner"].items()},
        **{f"confirm, {name}": value for name, value in asked["confirm"].items()},
        "tasks of the search": [" → ".join(task) for task in searched],
        "held-out tasks": [" → ".join(task) for task in held_out],
    }
    return _facts(facts)


def _facts(facts: Mapping[str, object]) -> tuple[str, ...]:
    """A table of names and values; nothing where there are none."""
    rows = [[name, _text(value)] for name, value in facts.items()]
    return (markdown_table(["What", "Value"], rows),) if rows else ()


def _text(value: object) -> str:
    if value is None or value in ((), [], {}):
        return "–"
    if isinstance(value, str):
        return value
    if isinstance(value, list | tuple):
        return ", ".join(map(_text, value))
    return json.dumps(value, ensure_ascii=False)


def _base(sweep: SweepSpec) -> tuple[str, ...]:
    return _facts(leaves(to_plain(base_spec(sweep)), "."))


def _costs(counts: Plain) -> tuple[str, ...]:
    """What was played for the sweep; all else was found in the store."""
    return tuple(
        f"- {name}: " + (", ".join(f"{kind} {count:,}" for kind, count in kinds.items()) or "none")
        for name, kinds in counts.items()
    )


def _again(sweep: SweepSpec, command: str, files: Iterable[str]) -> tuple[str, ...]:
    """The command, and where the numbers are."""
    links = [f"[{name}]({name})" for name in files]
    if sweep.tables:
        links.append("[its points as a table](../table/report/index.html)")
    return ("```", command, "```", "", f"The numbers: {', '.join(links)}.")

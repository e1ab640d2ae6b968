"""How far are No-Stitch and Random-Stitch from the paper's? What data are chosen by.

MB-Stitch has no part in it, so that what it gains on the data chosen was not chosen for.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import permutations

import pandas as pd

from analysis.paper.implied import MEAN, bounds, skills
from analysis.paper.misfit import PROFILED, misfit
from analysis.paper.numbers import paper_scores
from analysis.paper.profile import MARGIN, profile
from analysis.tables.writers import markdown_table
from orchestrator.errors import UsageError
from orchestrator.spec.methods import method_label
from orchestrator.spec.spec import Spec
from orchestrator.spec.structure import Plain
from sweeps.player import PlayedSpec, SpecPlayer
from sweeps.questions.question import SHOWN, Metric, Question
from sweeps.space import Fields, replaced

RANDOM = "random-stitch"
LENGTHS = {2, 3, 4}  # Table 2's
PROFILES_SHOWN = 5  # of the best trials


@dataclass(frozen=True)
class Profiled:
    """How one setting's unstitched skills did, and both methods."""

    profiles: Mapping[str, pd.DataFrame]  # method → `analysis.paper.profile.COLUMNS`
    scores: Mapping[tuple[str, int], float]  # (method, skills of a task) → mean over such tasks

    @property
    def method(self) -> str:
        return " and ".join(map(method_label, self.profiles))

    def result(self, *names: str) -> Plain:
        """Misfit and its parts; the rates themselves, by method, kind and skill."""
        parts = misfit(self.profiles[PROFILED], self.scores)
        two = {method: score for (method, length), score in self.scores.items() if length == 2}
        own = self.profiles[PROFILED]
        by_skill = own[own["skill"] != MEAN]
        return {
            "misfit": parts.total,
            "first": parts.first,
            "second": parts.second,
            "cells": parts.cells,
            "inside": int(by_skill["inside"].sum()),
            "no_stitch": two[PROFILED],
            "random_stitch": two[RANDOM],
            "profile": {method: _rates(table) for method, table in self.profiles.items()},
        }

    def instances(self, places: dict[tuple[str, int], int]) -> dict[int, float]:
        """None: a misfit is of all episodes together."""
        return {}


class MisfitQuestion(Question[Profiled]):
    """Settings of data and of skills, each under its own models; dynamics are not needed."""

    main = "misfit"
    metrics = {"misfit": Metric("misfit to the paper", maximised=False)}  # noqa: RUF012
    shared = ()
    own = (PROFILED, RANDOM)
    searched = ("data", "agent", "rollout")

    def check(self, spec: Spec, where: str) -> None:
        """A cell of the paper's is a mean over all permutations, and a profile over all pairs."""
        lengths = {len(task) for task in spec.all_tasks}
        every = {task for n in lengths for task in permutations(spec.skill_names, n)}
        whole = every == set(spec.all_tasks) and 2 in lengths and lengths <= LENGTHS
        if set(spec.skill_names) != set(skills()) or not whole:
            raise UsageError(
                f"{where}: a misfit is of all pairs of Kitchen's skills (and of all tasks of "
                "three or four, or none): set base = 'table2', settings = { lengths = [2], "
                "tasks = [] }, and hold nothing out"
            )

    def play(
        self,
        player: SpecPlayer,
        base: Spec,
        candidates: Sequence[Fields],
        seeds: Sequence[int] | None,
    ) -> list[Profiled]:
        where = f"sweep over {base.name}"
        specs = [replaced(base, fields, where) for fields in candidates]
        player.prepare(specs, seeds)
        return [profiled(player.play(spec, seeds), spec.methods) for spec in specs]

    def again(self, found: Plain, measured: Profiled, base: Profiled, *names: str) -> Plain:
        return {"search_misfit": found["misfit"]} | measured.result(*names)

    def headline(self, result: Plain) -> str:
        return (
            f"misfit {result['misfit']:.3f} (first skills {result['first']:.3f}, "
            f"second {result['second']:.3f}, cells {result['cells']:.3f})"
        )

    @property
    def note(self) -> str:
        return (
            "A misfit is how far No-Stitch and Random-Stitch are from the paper's: the distance of "
            "No-Stitch's first and second skills from what Table 8 implies for each, averaged over "
            "skills, and added to it the distance of both methods' scores from Table 2's. "
            "MB-Stitch is not played. A misfit has no interval; chance alone adds to it, and the "
            "more the fewer the episodes."
        )

    def seeds_note(self, seeds: int) -> str:
        return f"Models are those of {seeds} seed{'s' * (seeds > 1)}: other trainings differ."

    def confirmed_lines(self, confirmed: Plain) -> Iterator[str]:
        rows, base = confirmed["trials"], confirmed["base"]
        first = rows[0]
        yield (
            f"- The winner's misfit is **{first['misfit']:.3f}** there, and was "
            f"{first['search_misfit']:.3f} in the search."
        )
        yield f"- The base's own setting: {self.headline(base)}."
        yield ""
        own = base | {"trial": "base", "setting": "the base's own"}
        yield from _summary([*rows, own])
        yield ""
        yield from _profiles([*rows, own])

    def trial_lines(self, objectives: Sequence[str], ranked: Sequence[Plain]) -> Iterator[str]:
        yield from _summary(ranked[:SHOWN])
        yield ""
        yield from _profiles(ranked[:PROFILES_SHOWN])


def profiled(played: PlayedSpec, methods: Sequence[str]) -> Profiled:
    """What a setting's episodes come to."""
    means = played.episodes.groupby(["method", "length"])["score"].mean().reset_index()
    return Profiled(
        {method: profile(played.segments, played.run, method) for method in methods},
        {(row["method"], int(row["length"])): row["score"] for row in means.to_dict("records")},
    )


def _rates(table: pd.DataFrame) -> dict[str, dict[str, float]]:
    """Kind → skill → rate."""
    return {
        str(kind): dict(zip(own["skill"], own["rate"].map(float), strict=True))
        for kind, own in table.groupby("kind")
    }


def _summary(trials: Sequence[Plain]) -> Iterator[str]:
    """One row a trial, the paper's own last."""
    printed = {method: paper_scores("2")["2 skills", method][0] for method in (PROFILED, RANDOM)}
    header = [
        "Trial", "Setting", "Misfit", "First skills", "Second skills", "Cells",
        f"Skills within {MARGIN}", *(f"{method_label(m)}, two skills" for m in printed),
    ]  # fmt: skip
    numbers = ("misfit", "first", "second", "cells")
    rows = [
        [
            str(trial["trial"]),
            trial["setting"],
            *(f"{trial[name]:.3f}" for name in numbers),
            f"{trial['inside']} of {2 * len(skills())}",
            *(f"{trial[name]:.3f}" for name in ("no_stitch", "random_stitch")),
        ]
        for trial in trials
    ]
    rows.append(["paper", *"–" * 6, *(f"{score:.3f}" for score in printed.values())])
    yield markdown_table(header, rows)


def _profiles(trials: Sequence[Plain]) -> Iterator[str]:
    """Every rate beside what the paper's Table 8 implies for it."""
    header = [
        "Method", "Succeeds", "Skill", "Paper implies", *(f"Trial {t['trial']}" for t in trials)
    ]  # fmt: skip
    rows = []
    for method in (PROFILED, RANDOM):
        for kind, skill, low, high in bounds(method).itertuples(index=False):
            rates = [trial["profile"][method][kind][skill] for trial in trials]
            implied = f"{low:.3f} to {high:.3f}"
            marked = [_marked(rate, low, high) for rate in rates]
            rows.append([method_label(method), kind, skill, implied, *marked])
    yield (
        "How often first and second skills succeed (the second: both do, averaged over what comes "
        f"first), beside what Table 8 implies; bold where more than {MARGIN} away from there."
    )
    yield ""
    yield markdown_table(header, rows)


def _marked(rate: float, low: float, high: float) -> str:
    near = (
        low - MARGIN - 1e-9 <= rate <= high + MARGIN + 1e-9
    )  # as `analysis.paper.profile` compares
    return f"{rate:.3f}" if near else f"**{rate:.3f}**"

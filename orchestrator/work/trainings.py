"""What is known of trainings while they go on: how far they are, how far the whole is, losses."""

from __future__ import annotations

import json
import time
from collections.abc import Collection, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cached_property

from orchestrator.costs.estimate import training_seconds
from orchestrator.spec.structure import Plain
from orchestrator.storage.store import Store
from orchestrator.work.checkpoints import News, curves_of, news_of
from orchestrator.work.plan import Plan
from orchestrator.work.progress import UnderWay
from orchestrator.work.recipes import Recipe
from stitching.data.mixtures import skill_pairs
from stitching.models.training import Curves
from stitching.streams import Label


@dataclass
class Trainings:
    """Of artifacts that are made side by side, for a person.

    Trainings whose checkpoints are not seen from here tell nothing until they have ended.
    """

    store: Store
    recipes: Mapping[str, Recipe]  # by key, with those of all inputs: see `Likeness`
    wanted: Collection[str]  # keys of those that are made
    skills: int  # of the benchmark
    _since: float = field(default_factory=time.time)
    _before: dict[str, tuple[float, int]] = field(default_factory=dict)  # when, how many updates

    @cached_property
    def _seconds(self) -> dict[str, float]:
        seconds = training_seconds(self.recipes, self.store)
        return {key: seconds[key] for key in self.wanted}

    def under_way(self, finished: Iterable[str], begun: Iterable[str]) -> UnderWay:
        """Of all that is wanted: `finished` are there; `begun` are not, but being made."""
        done = sum(self._seconds.get(key, 0.0) for key in finished)
        lines = []
        for key in sorted(begun):
            news = news_of(self.store.checkpoint_folder(key), self._since)
            if news is not None:
                updates = self._updates(key, news)
                lines.append(self._told(key, news, updates))
                done += self._seconds[key] * min(1.0, news.done / updates)
        whole = sum(self._seconds.values())
        return UnderWay("; ".join(lines), min(1.0, done / whole) if whole else None)

    def _updates(self, key: str, news: News) -> int:
        """Of all trainings of an artifact: those that have not begun are as long as the others."""
        recipe = self.recipes[key]
        if recipe.params.get("config", {}).get("multi_task", True):
            return news.updates
        each = {"agent": self.skills, "mf-policy": len(skill_pairs(self.skills))}
        return max(news.updates, each.get(recipe.kind, 1) * news.updates // news.trainings)

    def _told(self, key: str, news: News, updates: int) -> str:
        recipe, now = self.recipes[key], time.monotonic()
        seed = f", seed {recipe.params['seed']}" if "seed" in recipe.params else ""
        line = f"{recipe.kind}{seed}: {news.done:,} of {updates:,} updates"
        then, done = self._before.setdefault(key, (now, news.done))
        if news.done > done:
            line += f" ({(news.done - done) / (now - then):.0f}/s)"
        elif news.done < done:  # another attempt
            self._before[key] = now, news.done
        losses = [f"{name} {value:.3g}" for name, value in news.losses.items()]
        return ", ".join([line, *losses[:1]])


@dataclass
class GrowingCurves:
    """Learning curves of a plan's models as `training.json` will have them, as far as they go."""

    plan: Plan
    store: Store
    _since: float = field(default_factory=time.time)
    _finished: dict[str, Curves] = field(default_factory=dict)  # by key

    def entries(self) -> list[Plain]:
        """One for each model, whether there is a curve already or not."""
        return [
            {
                "kind": recipe.kind,
                "seed": recipe.params["seed"],
                "key": key,
                "curves": self._curves(recipe),
            }
            for key, recipe in self.plan.recipes.items()
            if key in self.plan.needed and "seed" in recipe.params
        ]

    def _curves(self, recipe: Recipe) -> Curves:
        kind, key = recipe.kind, recipe.key
        if key not in self._finished and (kind, key) in self.store:
            with suppress(OSError, ValueError):  # it is being replaced
                info = json.loads(
                    (self.store.path(kind, key) / "info.json").read_text(encoding="utf-8")
                )
                self._finished[key] = info.get("curves", {})
        if key in self._finished:
            return self._finished[key]
        curves: Curves = {}
        for labels, own in curves_of(self.store.checkpoint_folder(key), self._since):
            curves |= _as_in_the_artifact(recipe, labels[len(OWN_LABELS) :], own)
        return curves


OWN_LABELS = ("kind", "benchmark", "root_seed", "seed")
"""Labels of a training that is an artifact's only one; of several, each has one more."""


def _as_in_the_artifact(recipe: Recipe, more: Sequence[Label], own: Curves) -> Curves:
    """The curves of one training by their names in its artifact; none where these are means."""
    if not more:
        return own
    if recipe.kind != "agent":
        return {}
    return {f"{name} of skill {more[0]}": curve for name, curve in own.items()}

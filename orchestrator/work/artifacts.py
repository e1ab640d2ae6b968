"""The recipes of what a spec needs: its datasets, its models, and what is only looked at."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from itertools import chain, pairwise
from typing import TypeVar

from orchestrator.benchmarks.entry import TRAINING_DATA, Dataset, Illustration
from orchestrator.benchmarks.registry import BENCHMARKS, ENTRIES
from orchestrator.spec.methods import SHARED, method_of, playing_modules, settings_with_effect
from orchestrator.spec.spec import Spec
from orchestrator.spec.structure import Plain, to_plain
from orchestrator.work.recipes import Recipe, code_fingerprint
from stitching.methods.mb_stitch import MB_STITCH
from stitching.methods.mf_stitch import MFStitchSettings
from stitching.methods.no_stitch import NO_STITCH
from stitching.methods.planning import PlanningSettings
from stitching.methods.protocol import MethodSettings
from stitching.methods.single_policy import SinglePolicySettings

S = TypeVar("S", bound=MethodSettings)


@dataclass
class Recipes:
    """By key, in an order in which they can be made."""

    spec: Spec
    by_key: dict[str, Recipe] = field(default_factory=dict)
    datasets: dict[str, str] = field(default_factory=dict)  # role → key; dynamics learn from all
    long_horizon: dict[str, str] = field(default_factory=dict)  # likewise, of Single-Policies
    models: dict[tuple[str, int, str], str] = field(default_factory=dict)  # see `Plan.models`
    illustrations: dict[str, str] = field(default_factory=dict)  # name → key

    def add(self, kind: str, params: Plain, inputs: dict[str, str] | None = None) -> str:
        """Key of the recipe; the same one twice is one."""
        recipe = Recipe(kind, {"benchmark": self.spec.benchmark, **params}, inputs or {})
        self.by_key[recipe.key] = recipe
        return recipe.key

    def add_datasets(self) -> None:
        """What skills and dynamics are learned from, where any method needs skills."""
        if not any(method_of(method).told for method in self.spec.methods):
            return
        for role, one in self._datasets_by_role.items():
            params = {"config": self.data_settings, **self.root, **one.params}
            self.datasets[role] = self.add(one.kind, params)

    def add_models(self) -> None:
        """What the spec's methods are played with, under every seed."""
        shared = [SHARED] if any(method_of(method).told for method in self.spec.methods) else []
        for kind, recipe_of in MODELS.items():
            for seed in range(self.spec.seeds):
                for method in (*self.spec.methods, *shared):
                    if kind in method_of(method).models:
                        self.models[kind, seed, method] = recipe_of(self, seed, method)

    def add_illustrations(self) -> None:
        """What is looked at of MB-Stitch, with seed 0's models; of several, the first one's."""
        mb_stitch = next((one for one in self.spec.methods if method_of(one) is MB_STITCH), None)
        if mb_stitch is None:
            return
        entry, data = ENTRIES[self.spec.benchmark], {"config": to_plain(self.spec.data)}
        extras = {role: self.add(kind, data | self.root) for role, kind in entry.extras.items()}
        models = {kind: self.models[kind, 0, mb_stitch] for kind in MB_STITCH.models}
        there = models | self.datasets | extras
        for name, one in entry.illustrations.items():
            roles = [
                self.demonstrations if role == TRAINING_DATA else (role,) for role in one.inputs
            ]
            inputs = {role: there[role] for role in chain.from_iterable(roles)}
            params = _illustrated(self.spec, one, mb_stitch)
            self.illustrations[name] = self.add(one.kind, params, inputs)

    @property
    def demonstrations(self) -> dict[str, str]:
        """The datasets that skills are learned from: role → key."""
        training = (role for role, one in self._datasets_by_role.items() if one.for_training)
        return {role: self.datasets[role] for role in training}

    @cached_property
    def data_settings(self) -> Plain:
        """Settings of the data, but for those that nothing learned from depends on."""
        looked_at = ENTRIES[self.spec.benchmark].for_extras
        settings = to_plain(self.spec.data)
        return {name: value for name, value in settings.items() if name not in looked_at}

    @cached_property
    def _datasets_by_role(self) -> dict[str, Dataset]:
        return ENTRIES[self.spec.benchmark].datasets(self.spec.data)

    def settings(self, method: str, expected: type[S]) -> S:
        """Of a method that asks for a model. Raises TypeError where they do not say how it is."""
        settings = self.spec.method_settings(method)
        if not isinstance(settings, expected):
            raise TypeError(f"{method}: has no {expected.__name__}, which its models need")
        return settings

    @property
    def root(self) -> dict[str, int]:
        return {"root_seed": self.spec.root_seed}

    @property
    def factors(self) -> Plain:
        """Which numbers of an observation belong together."""
        plain: Plain = to_plain(BENCHMARKS[self.spec.benchmark].factors)
        return plain


def _agent(recipes: Recipes, seed: int, method: str) -> str:
    learner = {"config": to_plain(recipes.spec.agent)}
    if recipes.spec.agent.alters:
        learner["factors"] = recipes.factors
    return recipes.add("agent", {**learner, **recipes.root, "seed": seed}, recipes.demonstrations)


def _initiation_sets(recipes: Recipes, seed: int, method: str) -> str:
    """The same for all seeds: they are of the data alone."""
    return recipes.add("initiation-sets", {"factors": recipes.factors}, recipes.demonstrations)


def _dynamics(recipes: Recipes, seed: int, method: str) -> str:
    params = {"config": to_plain(recipes.spec.dynamics), "seed": seed, **recipes.root}
    return recipes.add("dynamics", params, recipes.datasets)


def _mf_policy(recipes: Recipes, seed: int, method: str) -> str:
    settings = recipes.settings(method, MFStitchSettings)
    params = {"config": to_plain(settings.training), "seed": seed, **recipes.root}
    fine_tuned = settings.mixture == "fine-tuned"
    start = {"agent": recipes.models["agent", seed, method]} if fine_tuned else {}
    inputs = recipes.demonstrations | start
    return recipes.add("mf-policy", params | {"mixture": settings.mixture}, inputs)


def _single_policy(recipes: Recipes, seed: int, method: str) -> str:
    settings = recipes.settings(method, SinglePolicySettings)
    kind = ENTRIES[recipes.spec.benchmark].long_horizon(recipes.spec.data)
    shown = {"config": recipes.data_settings | {"episodes": settings.episodes}, **recipes.root}
    key = recipes.add(kind, shown | {"order": settings.order})
    recipes.long_horizon[f"demonstrations of {method}"] = key
    params = {"config": to_plain(settings.training), "seed": seed, **recipes.root}
    return recipes.add("single-policy", params, {"long-horizon": key})


MODELS: dict[str, Callable[[Recipes, int, str], str]] = {
    "agent": _agent,
    "initiation-sets": _initiation_sets,
    "dynamics": _dynamics,
    "mf-policy": _mf_policy,
    "single-policy": _single_policy,
}
"""How the recipe of a kind of model is made, for a seed and the method that asks for it."""


def _illustrated(spec: Spec, illustration: Illustration, mb_stitch: str) -> Plain:
    """Parameters of an illustration; one that plays a task does so by No-Stitch and `mb_stitch`.

    mb_stitch: one of its MB-Stitches. What takes stitches apart knows what No-Stitch is.
    """
    settings = spec.method_settings(mb_stitch)
    assert isinstance(settings, PlanningSettings)
    params: Plain = {
        "rollout": to_plain(spec.rollout),
        "step_limit": spec.step_limit,
        "root_seed": spec.root_seed,
        "seed": 0,
        "code": code_fingerprint(tuple(sorted(playing_modules(mb_stitch, settings)))),
    }
    played = [(mb_stitch, settings_with_effect(settings))]
    if illustration.pairs:
        return params | {
            "methods": played,
            "pairs": _spread_out(_neighbours(spec), illustration.pairs),
            "episodes": min(illustration.episodes, spec.episodes),
        }
    task = illustration.task
    if not task:
        return params | {"horizon": settings.chosen.horizon}
    return params | {
        # Whatever their order in the spec.
        "methods": [(one, {}) for one in spec.methods if method_of(one) is NO_STITCH] + played,
        "task": task if task in spec.all_tasks else max(spec.all_tasks, key=len),
    }


def _neighbours(spec: Spec) -> list[tuple[str, ...]]:
    """Skills that follow one another in some task, each pair once."""
    return list(dict.fromkeys(pair for task in spec.all_tasks for pair in pairwise(task)))


def _spread_out(pairs: list[tuple[str, ...]], most: int) -> list[tuple[str, ...]]:
    """At most so many, at equal distances, with the first and the last."""
    if len(pairs) <= most:
        return pairs
    return [pairs[round(i * (len(pairs) - 1) / max(1, most - 1))] for i in range(most)]

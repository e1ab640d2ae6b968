"""A spec expanded: the artifacts it takes, the rollout tree, and every block's name."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property
from itertools import chain, pairwise
from typing import Any

from orchestrator.builders import BLOCK_CODE, BLOCK_SETUP
from orchestrator.jobs import BlockTask
from orchestrator.kits import KITS, TEACHING, Illustration
from orchestrator.methods import (
    SKILLS,
    MFStitchConfig,
    SinglePolicyConfig,
    first_method,
    method_name,
    method_of,
    method_rollout,
)
from orchestrator.recipes import Recipe, code_fingerprint, digest
from orchestrator.spec import Spec
from orchestrator.structure import Plain, to_plain
from stitching.envs.registry import BENCHMARKS

Prefix = tuple[str, ...]


@dataclass(frozen=True)
class Node:
    """One more skill for the episodes that survived a prefix."""

    seed: int
    method: str  # "" for the first skills that methods share
    prefix: Prefix
    parent: Node | None = field(default=None, compare=False, repr=False)


@dataclass(frozen=True)
class Plan:
    """Artifacts in an order in which they can be made, and the tree of nodes, parents first."""

    spec: Spec
    recipes: dict[str, Recipe]  # by key
    agents: dict[int, str]  # seed → key
    dynamics: dict[int, str]
    mf_policies: dict[tuple[int, str], str]  # (seed, method) → key
    single_policies: dict[tuple[int, str], str]
    initiation_sets: dict[int, str]  # seed → key, the same for all: they are of the data alone
    datasets: dict[str, str]  # role → key
    illustrations: dict[str, str]  # name → key
    nodes: tuple[Node, ...]

    @cached_property
    def scored_kinds(self) -> set[str]:
        """Kinds of the artifacts that scores depend on, which illustrations are not among."""
        return {self.recipes[key].kind for key in (*self.models, *self.datasets.values())}

    @property
    def models(self) -> set[str]:
        """Keys of all that is trained."""
        own = {*self.mf_policies.values(), *self.single_policies.values()}
        for_all = {*self.agents.values(), *self.dynamics.values(), *self.initiation_sets.values()}
        return for_all | own

    @cached_property
    def chunks(self) -> list[tuple[int, int]]:
        """Episode ranges of a node's blocks."""
        size, total = self.spec.block_episodes, self.spec.episodes
        return [(first, min(first + size, total)) for first in range(0, total, size)]

    @cached_property
    def tasks(self) -> dict[tuple[Node, int], BlockTask]:
        """Every block by node and chunk, parents first."""
        return {
            (node, chunk): self._task(node, episodes)
            for node in self.nodes
            for chunk, episodes in enumerate(self.chunks)
        }

    @cached_property
    def children(self) -> dict[Node, list[Node]]:
        following: dict[Node, list[Node]] = {}
        for node in self.nodes:
            if node.parent is not None:
                following.setdefault(node.parent, []).append(node)
        return following

    @property
    def needed(self) -> set[str]:
        """Artifacts that the numbers depend on: all but what is only looked at."""
        inputs = (self.recipes[made].inputs.values() for made in self.models)
        return self.models.union(*inputs)

    def roots(self) -> Iterator[Node]:
        return (node for node in self.nodes if node.parent is None)

    @cached_property
    def _plain(self) -> Plain:
        """Plain settings by what they are of: a paper's table has a hundred thousand blocks."""
        methods = {method: self.spec.method_config(method) for method in self.spec.methods}
        parts = {"dynamics": self.spec.dynamics, **methods}
        return {name: to_plain(part) for name, part in parts.items()}

    @cached_property
    def _rollouts(self) -> Plain:
        """Likewise how skills are executed, by method."""
        methods = ("", *self.spec.methods)
        return {method: to_plain(method_rollout(method, self.spec.rollout)) for method in methods}

    def _artifact(self, kind: str, node: Node) -> str:
        """Key of the artifact of a kind that a node's blocks are played with."""
        for_all = {
            "agent": self.agents,
            "dynamics": self.dynamics,
            "initiation-sets": self.initiation_sets,
        }
        own = {"mf-policy": self.mf_policies, "single-policy": self.single_policies}
        return for_all[kind][node.seed] if kind in for_all else own[kind][node.seed, node.method]

    def _task(self, node: Node, episodes: tuple[int, int]) -> BlockTask:
        spec = self.spec
        artifacts = {kind: self._artifact(kind, node) for kind in method_of(node.method).artifacts}
        content = {
            "benchmark": spec.benchmark,
            "root_seed": spec.root_seed,
            "seed": node.seed,
            # Planner streams are named by the kind of method, so that settings of one method are
            # compared under common random numbers.
            "method": method_name(node.method) if node.method else "",
            "stitcher": self._plain[node.method] if node.method else {},
            "prefix": node.prefix,
            "episodes": episodes,
            "step_limit": spec.step_limit,
            "rollout": self._rollouts[node.method],
            "artifacts": artifacts,
            "configs": {kind: self._plain[kind] for kind in artifacts if kind == "dynamics"},
        }
        key = digest(content | {"code": code_fingerprint(BLOCK_CODE, BLOCK_SETUP)})
        return BlockTask(key=key, **content)


def make_plan(spec: Spec) -> Plan:
    """Expand a spec. Pure: looks at neither store nor ledger."""
    recipes: dict[str, Recipe] = {}

    def add(kind: str, params: Plain, inputs: dict[str, str] | None = None) -> str:
        recipe = Recipe(kind, {"benchmark": spec.benchmark, **params}, inputs or {})
        recipes[recipe.key] = recipe
        return recipe.key

    root = {"root_seed": spec.root_seed}
    kit = KITS[spec.benchmark]
    settings = to_plain(spec.data)
    learned_from = {name: x for name, x in settings.items() if name not in kit.for_extras}
    needed = {kind for method in spec.methods for kind in method_of(method).artifacts}
    made = kit.datasets(spec.data) if SKILLS in needed else {}
    datasets = {
        role: add(one.kind, {"config": learned_from, **root, **one.params})
        for role, one in made.items()
    }
    demonstrations = {role: datasets[role] for role, one in made.items() if one.teaches}
    seeds = range(spec.seeds if SKILLS in needed else 0)
    factors = to_plain(BENCHMARKS[spec.benchmark].factors)
    parts = {"factors": factors} if spec.agent.alters else {}
    learner = {"config": to_plain(spec.agent), **parts, **root}
    agents = {seed: add("agent", {**learner, "seed": seed}, demonstrations) for seed in seeds}
    initiation_sets = {}
    if "initiation-sets" in needed:
        key = add("initiation-sets", {"factors": factors}, demonstrations)
        initiation_sets = dict.fromkeys(seeds, key)
    dynamics, mf_policies, single_policies, long_horizon = {}, {}, {}, {}
    for seed in range(spec.seeds):
        if "dynamics" in needed:
            params = {"config": to_plain(spec.dynamics), "seed": seed, **root}
            dynamics[seed] = add("dynamics", params, datasets)
        for method in spec.methods:
            config = spec.method_config(method)
            if isinstance(config, MFStitchConfig):
                params = {"config": to_plain(config.training), "seed": seed, **root}
                params["mixture"] = config.mixture
                start = {"agent": agents[seed]} if config.mixture == "fine-tuned" else {}
                mf_policies[seed, method] = add("mf-policy", params, demonstrations | start)
            if isinstance(config, SinglePolicyConfig):
                shown = {"config": learned_from | {"episodes": config.episodes}, **root}
                shown |= {"order": config.task.split(">")}
                key = add(kit.long_horizon(spec.data), shown)
                long_horizon[f"demonstrations of {method}"] = key
                params = {"config": to_plain(config.training), "seed": seed, **root}
                single_policies[seed, method] = add("single-policy", params, {"long-horizon": key})
    illustrations = {}
    if any(method_name(method) == "mb-stitch" for method in spec.methods):
        extras = {
            role: add(kind, {"config": settings, **root}) for role, kind in kit.extras.items()
        }
        there = {"agent": agents[0], "dynamics": dynamics[0], **datasets, **extras}
        for name, one in kit.illustrations.items():
            roles = [demonstrations if role == TEACHING else (role,) for role in one.inputs]
            inputs = {role: there[role] for role in chain.from_iterable(roles)}
            illustrations[name] = add(one.kind, _illustrated(spec, one), inputs)
    return Plan(
        spec,
        recipes,
        agents,
        dynamics,
        mf_policies,
        single_policies,
        initiation_sets,
        datasets | long_horizon,
        illustrations,
        tuple(_nodes(spec)),
    )


def _illustrated(spec: Spec, illustration: Illustration) -> Plain:
    """Parameters of an illustration; one that plays a task does so by No- and MB-Stitch.

    Of several MB-Stitches, the first. One that takes stitches apart knows what No-Stitch is.
    """
    params: Plain = {
        "configs": {"dynamics": to_plain(spec.dynamics)},
        "rollout": to_plain(spec.rollout),
        "step_limit": spec.step_limit,
        "root_seed": spec.root_seed,
        "seed": 0,
    }
    ours = _settings(spec, "mb-stitch")[:1]
    if illustration.pairs:
        return params | {
            "methods": ours,
            "pairs": _spread_out(_neighbours(spec), illustration.pairs),
            "episodes": min(illustration.episodes, spec.episodes),
        }
    task = illustration.task
    if not task:
        return params | {"horizon": spec.mb_stitch.chosen.horizon}
    return params | {
        # Whatever their order in the spec.
        "methods": _settings(spec, "no-stitch") + ours,
        "task": task if task in spec.all_tasks else max(spec.all_tasks, key=len),
    }


def _settings(spec: Spec, kind: str) -> list[list[Any]]:
    """The spec's methods of a kind, each with its settings."""
    return [
        [method, to_plain(spec.method_config(method))]
        for method in spec.methods
        if method_name(method) == kind
    ]


def _neighbours(spec: Spec) -> list[Prefix]:
    """Skills that follow one another in some task, each pair once."""
    return list(dict.fromkeys(pair for task in spec.all_tasks for pair in pairwise(task)))


def _spread_out(pairs: list[Prefix], most: int) -> list[Prefix]:
    """At most so many, at equal distances, with the first and the last."""
    if len(pairs) <= most:
        return pairs
    return [pairs[round(i * (len(pairs) - 1) / max(1, most - 1))] for i in range(most)]


def _nodes(spec: Spec) -> list[Node]:
    """Every prefix of every task, parents first, each once."""
    nodes: dict[tuple[int, str, Prefix], Node] = {}
    for seed in range(spec.seeds):
        for depth in range(1, max(map(len, spec.all_tasks)) + 1):
            for method in spec.methods:
                first = first_method(method, spec.rollout)
                player = method if depth > 1 else first
                above = method if depth > 2 else first
                for task in spec.all_tasks:
                    place = seed, player, task[:depth]
                    if len(task) >= depth and place not in nodes:
                        parent = nodes[seed, above, task[: depth - 1]] if depth > 1 else None
                        nodes[place] = Node(*place, parent)
    return list(nodes.values())

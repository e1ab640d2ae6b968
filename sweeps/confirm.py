"""Honest winners: the best trials again, on tasks and seeds that the search has never seen."""

from __future__ import annotations

from dataclasses import replace

from orchestrator.spec.spec import Spec
from orchestrator.spec.structure import Plain
from sweeps.player import SpecPlayer
from sweeps.space import describe
from sweeps.spec import SweepSpec, base_spec, split_tasks
from sweeps.study import SweepStudy, result_of


def confirm_spec(sweep: SweepSpec) -> tuple[Spec, tuple[int, ...]]:
    """What the best trials are played on again, and by which seeds.

    Without held-out tasks only the seeds are new. A new seed retrains everything; another root
    seed makes other data, too.
    """
    base, wanted = base_spec(sweep), sweep.confirm
    searched, held_out = split_tasks(sweep, base)
    root_seed = base.root_seed if wanted.root_seed is None else wanted.root_seed
    first = base.seeds if root_seed == base.root_seed else 0
    seeds = wanted.seeds or tuple(range(first, first + base.seeds))
    spec = replace(
        base,
        lengths=(),
        tasks=tuple(map(">".join, held_out or searched)),
        root_seed=root_seed,
        seeds=max(seeds) + 1,
        episodes=wanted.episodes or base.episodes,
    )
    return spec, seeds


def confirm(sweep: SweepSpec, study: SweepStudy, player: SpecPlayer) -> Plain:
    """The best trials beside the base's own setting, measured as in the search.

    The winner is the search's best. The others are there to compare it with: a winner chosen by
    these episodes could not be judged by them.
    """
    best = study.ranked()[: sweep.confirm.best]
    if not best:
        return {}
    spec, seeds = confirm_spec(sweep)
    candidates = [study.fields(trial) for trial in best]
    *all_measured, base = sweep.question.play(player, spec, [*candidates, {}], seeds)
    rows = []
    for trial, measured in zip(best, all_measured, strict=True):
        names = (sweep.name, "confirm", str(trial.number))
        again = sweep.question.again(result_of(trial), measured, base, *names)
        rows.append(
            {
                "trial": trial.number,
                "fields": study.fields(trial),
                "setting": describe(study.fields(trial)),
            }
            | again
        )
    return {
        "tasks": list(spec.tasks),
        "held_out": bool(split_tasks(sweep, base_spec(sweep))[1]),
        "seeds": list(seeds),
        "root_seed": spec.root_seed,
        "episodes": spec.episodes,
        "base": base.result(sweep.name, "confirm", "base"),
        "trials": rows,
    }

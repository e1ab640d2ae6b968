"""The search itself: batches of trials, played in rounds, some given up between two rounds."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from copy import copy
from dataclasses import replace
from math import ceil

import numpy as np
from optuna.trial import FrozenTrial

from orchestrator.spec.spec import Spec
from orchestrator.spec.structure import Plain
from orchestrator.work.progress import Progress
from stitching.streams import stream
from sweeps.player import SpecPlayer
from sweeps.questions.question import Measured
from sweeps.space import describe
from sweeps.spec import SweepSpec, base_spec, split_tasks
from sweeps.study import SweepStudy, expected, is_kept, result_of, wilcoxon


def search_spec(sweep: SweepSpec) -> Spec:
    """The base on the search's tasks alone, in the order that rounds follow.

    Families of tasks, which begin with the same two skills, are shuffled and stay together: a
    round then costs its share of the tree, and no more.
    """
    base = base_spec(sweep)
    searched, _ = split_tasks(sweep, base)
    if sweep.pruner.rounds > 1:
        families = list(dict.fromkeys(task[:2] for task in searched))
        order = stream("order of tasks", sweep.seed).permutation(len(families))
        searched = [t for place in order for t in searched if t[:2] == families[place]]
    return replace(base, lengths=(), tasks=tuple(map(">".join, searched)))


def rounds(spec: Spec, count: int) -> list[Spec]:
    """Ever larger parts of a spec, the last one all of it: more episodes, or else more tasks.

    Episodes are added by whole blocks, so that every part is found again in the next. With enough
    of them every round has all tasks, and what is told of a trial given up is not the luck of
    easy ones.
    """
    blocks = ceil(spec.episodes / spec.block_episodes)
    if blocks >= min(count, len(spec.tasks)):
        shares = [ceil(blocks * part / count) for part in range(1, count + 1)]
        return [
            replace(spec, episodes=min(spec.episodes, share * spec.block_episodes))
            for share in dict.fromkeys(shares)
        ]
    sizes = [ceil(len(spec.tasks) * part / count) for part in range(1, count + 1)]
    return [replace(spec, tasks=spec.tasks[:size]) for size in dict.fromkeys(sizes)]


def run_search(
    sweep: SweepSpec, study: SweepStudy, player: SpecPlayer, progress: Progress
) -> Iterator[None]:
    """Play and tell every trial that is missing; yields after each batch."""
    spec = search_spec(sweep)
    progress.phase("trials", sweep.budget, len(study.finished))
    while batch := study.next_batch():
        # With some of a batch told, the others' results are there: they were kept before.
        unplayed = [trial for trial in batch if not is_kept(trial)]
        _play_batch(sweep, spec, study, unplayed, player)
        study.tell(batch)
        for trial in batch:
            progress.advance()
            progress.say(trial_line(study, study.trials[trial.number]))
        yield


def _play_batch(
    sweep: SweepSpec, spec: Spec, study: SweepStudy, batch: list[FrozenTrial], player: SpecPlayer
) -> None:
    """Play trials and keep their results, those of given-up ones on what they played."""
    places = {
        (task, episode): place * spec.episodes + episode
        for place, task in enumerate(spec.tasks)
        for episode in range(spec.episodes)
    }
    parts = rounds(spec, sweep.pruner.rounds)
    going_on = list(batch)
    shown: dict[int, tuple[Measured, int]] = {}  # number → what it did, in how many rounds
    for done, part in enumerate(parts, start=1):
        fields = [study.fields(trial) for trial in going_on]
        all_measured = sweep.question.play(player, part, fields, None)
        shown |= {t.number: (s, done) for t, s in zip(going_on, all_measured, strict=True)}
        if len(parts) == 1:
            break
        instances = [measured.instances(places) for measured in all_measured]
        for trial, gains in zip(going_on, instances, strict=True):
            _report(study, trial, gains)
        if done < len(parts):
            judged = zip(going_on, instances, strict=True)
            going_on = [trial for trial, gains in judged if not _hopeless(study, trial, gains)]
    for trial in batch:
        measured, done = shown[trial.number]
        result = measured.result(sweep.name, str(trial.number))
        result |= {"pruned": done < len(parts), "rounds": done, "method": measured.method}
        if result["pruned"]:
            result[expected("gain")] = _expected_gain(study, result)
        study.keep(trial, result)


def _report(study: SweepStudy, trial: FrozenTrial, instances: dict[int, float]) -> None:
    """Write down the instances that the study does not have yet."""
    known = study.trials[trial.number].intermediate_values
    handle = study.handle(trial)
    for place in sorted(instances.keys() - known.keys()):
        handle.report(instances[place], place)


def _hopeless(study: SweepStudy, trial: FrozenTrial, instances: dict[int, float]) -> bool:
    """Whether a trial is told from the best of earlier batches on the instances both have.

    Environments draw the same random numbers in all trials, which the pairing cancels. The
    instances are those of this round, though a killed process may have left later ones behind.
    """
    seen = copy(trial)
    seen.intermediate_values = instances
    return wilcoxon(study.sweep).prune(study.study, seen)


def _expected_gain(study: SweepStudy, result: Plain) -> float:
    """What a given-up trial's gain over all tasks would be: as far from the best's as on its own.

    The tasks it has played may be easier than the rest, and its plain gain would mislead a sampler.
    """
    ranked = study.ranked()
    if not ranked:  # nothing keeps to the constraints yet
        return float(result["gain"])
    best = result_of(ranked[0])
    behind = [gain - best["tasks"][task] for task, gain in result["tasks"].items()]
    return float(best["gain"] + np.mean(behind))


def trial_line(study: SweepStudy, trial: FrozenTrial) -> str:
    """ "trial 7: gain +0.213 [+0.150, +0.270], alpha 3.1, beta 0.5" """
    result = result_of(trial)
    best: Sequence[FrozenTrial] = study.ranked()[:1]
    note = " · best so far" if best and best[0].number == trial.number else ""
    note = f" · given up after round {result['rounds']}" if result["pruned"] else note
    return (
        f"trial {trial.number}: {study.sweep.question.headline(result)}, "
        f"{describe(study.fields(trial))}{note}"
    )

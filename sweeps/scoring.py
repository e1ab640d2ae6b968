"""What a candidate's episodes come to: its gain over No-Stitch, its score, and its planning.

A table's tasks are all that it is about. A sweep's are some of many: drawn for the search, or held
out so that a winner can be judged where it was not chosen. What is asked is whether a setting would
gain on such tasks, so intervals here resample tasks, too, in the families (the same first two
skills) in which `sweeps.spec.split_tasks` draws them, beside seeds and each first skill's episodes.
They are therefore wider than those of a table of the same episodes, and with a handful of families
rough. Of tasks that were picked by hand they say what they would if these had been drawn.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd

from analysis.statistics import Gain, generator, paired_differences, paired_gain
from orchestrator.spec.methods import first_method
from orchestrator.spec.spec import Spec
from orchestrator.spec.structure import Plain
from stitching.methods.mb_stitch import MBStitchSettings
from sweeps.candidates import NO_STITCH, group
from sweeps.player import PlayedSpec, SpecPlayer
from sweeps.space import Fields


@dataclass(frozen=True)
class MeasuredGain:
    """How one candidate did beside No-Stitch under the base's models."""

    method: str
    settings: MBStitchSettings
    segments: pd.DataFrame  # its own: of first skills only those that it stitches to
    episodes: pd.DataFrame
    baseline: pd.DataFrame  # No-Stitch's episodes
    own_first_skill: bool = False  # it stitches to first skills

    def gain_over(self, other: pd.DataFrame, *names: str) -> Gain:
        """Paired by seed, task and episode; the interval's draws belong to these names."""
        return paired_gain(self.episodes, other, generator("sweep", *names), other_tasks=True)

    def result(self, *names: str) -> Plain:
        """The metrics of a trial (see `sweeps.questions.gain`)."""
        gain = self.gain_over(self.baseline, *names)
        return {
            "gain": gain.difference,
            "gain_low": gain.low,
            "gain_high": gain.high,
            "score": gain.score_first,
            "no_stitch": gain.score_second,
            "imagined": self.imagined,
            "pairs": gain.pairs,
            "tasks": self.by_task(),
        }

    def by_task(self) -> dict[str, float]:
        """Task → its paired gain over No-Stitch."""
        pairs = paired_differences(self.episodes, self.baseline)
        means = pairs.groupby(["task", "seed"])["difference"].mean().groupby("task").mean()
        return {str(task): float(gain) for task, gain in means.items()}

    @property
    def imagined(self) -> float:
        """Model steps that planning one stitch takes, at most.

        plans · samples · horizon, with one plan for every `execute` steps of the stitch. It is an
        upper bound where CEM converges early, but, unlike seconds, the same on any machine and for
        any number of workers.
        """
        if self.segments.empty:
            return 0.0
        stitch_steps = self.segments["stitch_steps"].to_numpy()
        plans = np.ceil(stitch_steps / self.settings.execute).mean()
        planner = self.settings.chosen
        return float(plans * planner.samples * planner.horizon)

    def instances(self, places: dict[tuple[str, int], int]) -> dict[int, float]:
        """Place of a (task, episode) → its paired gain over No-Stitch, mean over seeds.

        Where candidates share first skills, episodes in which these failed are left out: nothing
        could have differed there.
        """
        key = ["seed", "task", "episode"]
        pairs = self.episodes.merge(self.baseline, on=key, suffixes=("", "_baseline"))
        begun = (pairs["accomplished"] > 0) | (pairs["accomplished_baseline"] > 0)
        pairs = pairs[begun | self.own_first_skill].copy()
        pairs["gain"] = (pairs["accomplished"] - pairs["accomplished_baseline"]) / pairs["length"]
        means = pairs[["task", "episode", "gain"]].groupby(["task", "episode"]).mean().reset_index()
        return {
            places[row["task"], int(row["episode"])]: float(row["gain"])
            for row in means.to_dict("records")
        }


def play_candidates(
    player: SpecPlayer, base: Spec, candidates: Sequence[Fields], seeds: Sequence[int] | None = None
) -> list[MeasuredGain]:
    """All candidates on the base's tasks and episodes; what they share is played once."""
    measured: dict[int, MeasuredGain] = {}
    baseline = pd.DataFrame()
    groups = group(candidates, base, f"sweep over {base.name}")
    player.prepare([one.spec for one in groups], seeds)
    for one in groups:
        played = player.play(one.spec, seeds)
        if NO_STITCH in one.spec.methods:
            baseline = _of(played.episodes, NO_STITCH)
        for place, method in one.methods.items():
            measured[place] = _measured(played, one.spec, method, baseline)
    return [measured[place] for place in range(len(candidates))]


def pareto_front(trials: Sequence[Plain]) -> list[Plain]:
    """Trials that no other one beats in gain without planning more."""
    return [
        one
        for one in trials
        if not any(
            other["gain"] >= one["gain"]
            and other["imagined"] <= one["imagined"]
            and (other["gain"], -other["imagined"]) != (one["gain"], -one["imagined"])
            for other in trials
        )
    ]


def _measured(played: PlayedSpec, spec: Spec, method: str, baseline: pd.DataFrame) -> MeasuredGain:
    settings = spec.method_settings(method)
    assert isinstance(settings, MBStitchSettings)
    return MeasuredGain(
        method,
        settings,
        _of(played.segments, method),
        _of(played.episodes, method),
        baseline,
        own_first_skill=bool(first_method(method, spec.rollout)),
    )


def _of(rows: pd.DataFrame, method: str) -> pd.DataFrame:
    return rows[rows["method"] == method]

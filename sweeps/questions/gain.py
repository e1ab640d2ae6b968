"""What does MB-Stitch gain over No-Stitch?"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from analysis.tables.writers import markdown_table, seed_note
from orchestrator.spec.spec import Spec
from orchestrator.spec.structure import Plain
from sweeps.candidates import NO_STITCH
from sweeps.player import SpecPlayer
from sweeps.questions.question import SHOWN, Metric, Question
from sweeps.scoring import MeasuredGain, pareto_front, play_candidates
from sweeps.space import Fields


class GainQuestion(Question[MeasuredGain]):
    """Settings of MB-Stitch, and of models, beside No-Stitch under the base's models."""

    main = "gain"
    metrics = {  # noqa: RUF012 (a constant of the class)
        # mean score over No-Stitch's, paired by seed, task and episode
        "gain": Metric("gain over No-Stitch", maximised=True, by_episode=True),
        # accomplished share of a task's skills
        "score": Metric("score", maximised=True, by_episode=True),
        # model steps that planning one stitch takes, at most
        "imagined": Metric("model steps a stitch, at most", maximised=False),
    }
    shared = (NO_STITCH,)
    own = ("mb-stitch",)
    searched = ("mb_stitch", "agent", "dynamics", "data", "rollout")

    def play(
        self,
        player: SpecPlayer,
        base: Spec,
        candidates: Sequence[Fields],
        seeds: Sequence[int] | None,
    ) -> list[MeasuredGain]:
        return play_candidates(player, base, candidates, seeds)

    def again(self, found: Plain, measured: MeasuredGain, base: MeasuredGain, *names: str) -> Plain:
        over_base = measured.gain_over(base.episodes, *names, "over the base")
        again = measured.result(*names)
        return {
            "search_gain": found["gain"],
            "survives": again["gain"] / found["gain"] if found["gain"] > 0 else None,
            "over_base": over_base.difference,
            "over_base_low": over_base.low,
            "over_base_high": over_base.high,
        } | again

    def headline(self, result: Plain) -> str:
        return f"gain {_interval(result, 'gain')}"

    @property
    def note(self) -> str:
        return (
            "A gain is the mean score over No-Stitch's, paired by seed, task and episode under "
            "common random numbers; intervals are 95 %, from a hierarchical bootstrap over seeds, "
            "tasks and episodes."
        )

    def seeds_note(self, seeds: int) -> str:
        return seed_note(seeds)

    def confirmed_lines(self, confirmed: Plain) -> Iterator[str]:
        rows, base = confirmed["trials"], confirmed["base"]
        first = rows[0]
        found, again = f"{first['search_gain']:+.3f}", _interval(first, "gain")
        if first["gain"] <= 0:
            yield f"- Nothing of the winner's gain of {found} in the search survives: **{again}**."
        else:
            left = f"{again}{_share(first)}"
            yield f"- Of the winner's gain of {found} in the search, **{left} survives**."
        yield (
            f"- Over the base's own setting it gains **{_interval(first, 'over_base')}**; that one "
            f"gains {_interval(base, 'gain')} over No-Stitch ({base['no_stitch']:.3f})."
        )
        better = [row for row in rows[1:] if row["gain"] > first["gain"]]
        if better:
            yield (
                f"- Trial {better[0]['trial']} did better here. The winner stays the search's: one "
                "chosen by these episodes could not be judged by them."
            )
        yield ""
        header = [
            "Trial", "Setting", "Gain in the search", "Gain here", "Survives", "Over the base's own"
        ]  # fmt: skip
        cells = [
            [
                str(row["trial"]), row["setting"], f"{row['search_gain']:+.3f}",
                _interval(row, "gain"), _share(row).strip(" ()") or "–",
                _interval(row, "over_base"),
            ]
            for row in rows
        ]  # fmt: skip
        yield markdown_table(header, cells)

    def trial_lines(self, objectives: Sequence[str], ranked: Sequence[Plain]) -> Iterator[str]:
        """With several objectives, the front that no other trial beats."""
        several = len(objectives) > 1
        shown = pareto_front(ranked) if several else ranked[:SHOWN]
        imagined = self.metrics["imagined"].label.capitalize()
        yield f"| Trial | Setting | Gain | Score | No-Stitch | {imagined} |"
        yield "| --- | --- | --- | --- | --- | --- |"
        for trial in shown:
            yield (
                f"| {trial['trial']} | {trial['setting']} | {_interval(trial, 'gain')} | "
                f"{trial['score']:.3f} | {trial['no_stitch']:.3f} | {trial['imagined']:,.0f} |"
            )


def _share(row: Plain) -> str:
    """ " (80 %)": how much of the search's gain is left, where it had any."""
    return "" if row["survives"] is None else f" ({100 * max(0.0, row['survives']):.0f} %)"


def _interval(row: Plain, name: str) -> str:
    return f"{row[name]:+.3f} [{row[f'{name}_low']:+.3f}, {row[f'{name}_high']:+.3f}]"

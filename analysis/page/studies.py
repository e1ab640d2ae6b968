"""Sections of the page about pairs of skills and about the models behind the scores."""

import math
from collections.abc import Mapping
from html import escape

import pandas as pd

from analysis.page.tables import html_table
from analysis.run import Run
from analysis.studies.forecast import FORECAST_NOTE, agreement, agreement_text
from analysis.studies.pairs import BASELINE, shown_orders
from analysis.studies.rates import HEADER, NOTE, rate_lines
from analysis.studies.stitches import FIRST_SKILLS, HAND_OVERS, OUTCOMES, WARNINGS, by_kind, label
from analysis.tables.writers import Record, seed_note

UNKNOWN = "–"


def pairs_section(run: Run, groups: pd.DataFrame | None) -> str:
    """Second skills by group of pairs and method; nothing where the data show no orders."""
    if groups is None:
        return ""
    baseline = run.spec.methods.get(BASELINE, "")
    gain = [f"Gain over {baseline}"] if baseline else []
    lines = [
        [
            _unbroken(f"{row['group']} ({row['pairs']})"),
            run.spec.methods[row["method"]],
            f"{row['successes']:,} of {row['trials']:,}",
            _unbroken(f"{row['rate']:.3f} [{row['ci_low']:.3f}, {row['ci_high']:.3f}]"),
            *([_gain(row, "gain")] if baseline else []),
            _unbroken(f"{row['both']:.3f} [{row['both_low']:.3f}, {row['both_high']:.3f}]"),
            *([_gain(row, "both_gain")] if baseline else []),
        ]
        for row in groups.to_dict("records")
    ]
    header = ["Pairs", "Method", "Second skill succeeds", "Rate", *gain, "Both succeed", *gain]
    return _note(
        "How often the second skill succeeds once the first has, and how often both do, over all "
        "episodes. A pair is in the data if its skills follow one another in some demonstration. "
        f"In rates{' and gains' if baseline else ''} every pair weighs the same, and every seed, "
        "so a rate may differ a little from successes over trials. "
        f"{_shared_firsts(run, baseline)}"
        "95 % intervals are from resampling seeds, and within a seed each first skill's episodes, "
        "together for all pairs that begin with it; pairs are fixed. "
        f"{seed_note(int(groups['seeds'].min()))}"
    ) + html_table(header, lines)


def _shared_firsts(run: Run, baseline: str) -> str:
    """Whose first skills the second ones follow, and how gains over the baseline are paired."""
    paired = f"Gains over {baseline} are paired by seed, pair and episode. " if baseline else ""
    if not run.spec.own_first_skill:
        return f"{paired}Methods share their first skills. "
    own = (
        "A method that stitches to first skills has its own, so it comes to other second skills "
        "than another, and from other states"
    )
    if not baseline:
        return f"{own}. "
    return (
        f"{paired}{own}: gains in the second skill are over those episodes alone in which the "
        "first one succeeded under both methods, gains in both skills over all. "
    )


def _gain(row: Record, name: str) -> str:
    if math.isnan(row[name]):
        return UNKNOWN
    return _unbroken(f"{row[name]:+.3f} [{row[f'{name}_low']:+.3f}, {row[f'{name}_high']:+.3f}]")


def _unbroken(text: str) -> str:
    return text.replace(" ", "\N{NO-BREAK SPACE}")


def forecast_section(table: pd.DataFrame | None) -> str:
    """How the forecast of pairs did; nothing where there is none, or too little was played."""
    found = None if table is None else agreement(table)
    return "" if found is None else _note(f"{FORECAST_NOTE} {agreement_text(found)}")


def rates_section(rates: pd.DataFrame | None) -> str:
    """Each skill's rates from its own starts and after others; nothing without a diagnosis."""
    if rates is None:
        return ""
    return html_table(HEADER, rate_lines(rates)) + _note(NOTE)


def models_section(run: Run, models: pd.DataFrame | None) -> str:
    """Policies and values by skill, dynamics by group; nothing without a diagnosis."""
    if models is None:
        return ""
    known: Known = {(row["measure"], row["of"]): row for row in models.to_dict("records")}
    return _skills(run, known) + _dynamics(run, known)


Known = dict[tuple[str, str], Record]


def _skills(run: Run, known: Known) -> str:
    starting = {order[0] for order in shown_orders(run.datasets) or [] if order}
    lines = [
        [
            run.spec.skill_label(skill),
            _rate(known.get(("competence", skill))),
            _rate(known.get(("from start pose", skill))) + (" *" if skill in starting else ""),
            _rate(known.get(("after other skills", skill))),
            _correlation(known.get(("value rank correlation", skill))),
            _auc(known.get(("auc", skill))),
        ]
        for skill in run.spec.skills
    ]
    header = [
        "Skill", "From its own starts", "From the start pose", "After other skills",
        "Value rises (ρ)", "Value tells (AUC)",
    ]  # fmt: skip
    baseline = run.spec.methods.get(BASELINE, BASELINE)
    return (
        "<h3>Policies and values</h3>"
        + html_table(header, lines)
        + _note(
            "Successes of trials, with Wilson's 95 % interval, which takes trials as independent "
            "and covers the models trained here: other training runs may differ by far more. "
            f"Own starts are where the skill's held-out demonstrations begin{_starts(run)}; the "
            f"start pose is that of an episode{' (*: in the data)' if starting else ''}; after "
            f"other skills is {baseline}, over all pairs. ρ: rank correlation of value with time "
            "along held-out demonstrations. AUC: how likely the value at the end of the preceding "
            f"skill is higher where the policy then succeeded than where it failed, under "
            f"{baseline}, compared within each seed, ties counted half; 0.5 tells nothing. In "
            "parentheses: how often it succeeded and failed. Own starts and ρ are of the first "
            "seed's models, the rest is over all seeds."
        )
    )


def _starts(run: Run) -> str:
    """ " (12 to 15 of each skill)", where the diagnosis counts them."""
    competence = run.diagnosis.get("competence", {}).values()
    counts = [study["starts"] for study in competence if "starts" in study]
    return f" ({min(counts)} to {max(counts)} of each skill)" if counts else ""


def _rate(row: Record | None) -> str:
    if row is None or not row["trials"]:
        return UNKNOWN
    interval = _unbroken(f"[{row['ci_low']:.2f}, {row['ci_high']:.2f}]")
    return f"{row['successes']} of {row['trials']} {interval}"


def _correlation(row: Record | None) -> str:
    if row is None or math.isnan(row["value"]):
        return UNKNOWN
    return f"{row['value']:+.2f} (n = {row['trials']})"


def _auc(row: Record | None) -> str:
    if row is None:
        return UNKNOWN
    counts = f"({row['successes']} + {row['trials'] - row['successes']})"
    return f"{UNKNOWN if math.isnan(row['value']) else format(row['value'], '.2f')} {counts}"


def _dynamics(run: Run, known: Known) -> str:
    predictions = run.diagnosis.get("predictions", {})
    if not predictions:
        return ""
    groups = dict.fromkeys(group for study in predictions.values() for group in study["groups"])
    lines = [
        [
            group,
            *(
                f"{known[f'relative error after {steps}', group]['value']:.3f} "
                f"({known[f'rmse error after {steps}', group]['value']:.3f})"
                for steps in predictions
            ),
        ]
        for group in groups
    ]
    lines.append(
        ["disagreement and error (ρ)"]
        + [f"{study['disagreement_rank_correlation']:+.2f}" for study in predictions.values()]
    )
    states = next(iter(predictions.values()))["states"]
    return (
        "<h3>Dynamics</h3>"
        + html_table(
            ["Numbers of the state", *(f"after {s} step{'s'[: s != '1']}" for s in predictions)],
            lines,
        )
        + _note(
            "Root mean square error of the ensemble's mean over the distance moved, in parentheses "
            f"in standard deviations of the training data; open loop, from {states:,} states of "
            "held-out demonstrations. 1 is no better than predicting that nothing moves. ρ: rank "
            "correlation of the members' disagreement with the error. Of the first seed's models."
        )
    )


def stitches_section(run: Run, studies: Mapping[str, pd.DataFrame]) -> str:
    """What stitches did to the skill they lead to, what was expected of them, and what warned."""
    if "stitch-outcomes" not in studies or studies["stitches"].empty:
        return ""
    parts = studies["stitch-outcomes"].to_dict("records")
    header = [
        "Stitches to", "Skill succeeds without", "with a stitch", "Stitches", "Helped", "Hurt",
        "Gain predicted", "Gain realised", "ρ", *(f"{name} (AUC)" for name in WARNINGS.values()),
    ]  # fmt: skip
    lines = [
        [
            label(row["part"], row["kind"]),
            *(f"{row[f'successes_{how}']} of {row['episodes']}" for how in ("without", "with")),
            *(str(row[name]) for name in ("stitches", "helped", "hurt")),
            *(_signed(row[name], 3) for name in ("predicted_gain", "realised_gain")),
            _signed(row["rank_correlation"], 2),
            *(_told(row[f"auc_{name}"]) for name in WARNINGS),
        ]
        for row in parts
    ]
    return (
        html_table(header, lines)
        + _by_outcome(studies["stitches"])
        + _note(
            f"{_begun_where(run)}"
            "once without a stitch and once with one, under the same random numbers. A stitch "
            "helped where the skill failed without and succeeded with it, and hurt where it "
            f"was the other way round; these are counts of few episodes ({_tried(run)}) by the "
            "first seed's models, and no interval goes with them. Gain: of that skill's value "
            "by a plan's first action, on average; ρ is the rank correlation of predicted with "
            "realised gains. AUC: how likely a stitch that hurt had the higher number of two, one "
            "that hurt and one that did not; 0.5 tells nothing, less is a number that is lower "
            "where stitches hurt. Spreads are those of Eq. 2 at the state predicted for a plan's "
            "first action, averaged over the stitch; distances are to that skill's own "
            "demonstrations, in standard deviations of the data."
        )
    )


def _by_outcome(stitches: pd.DataFrame) -> str:
    """Means over the stitches of each outcome, by part and kind."""
    lines = [
        [
            f"{label(str(part), str(kind))}: {name}",
            str(len(own)),
            f"{own['steps'].mean():.1f}",
            *(
                f"{own[f'{what}_start'].mean():.{digits}f} → {own[f'{what}_end'].mean():.{digits}f}"
                for what, digits in (("value", 2), ("distance", 3))
            ),
            f"{own['value_spread'].mean():.3f}",
            f"{own['dynamics_spread'].mean():.4f}",
        ]
        for (part, kind), of_kind in stitches.groupby(["part", "kind"], sort=False)
        for name in OUTCOMES.values()
        if len(own := of_kind[of_kind["outcome"] == name])
    ]
    header = [
        "The stitch", "Stitches", "Steps", "Value", "Distance to data", "Spread of values",
        "Spread of dynamics",
    ]  # fmt: skip
    return html_table(header, lines)


def _tried(run: Run) -> str:
    """ "7 first skills and 20 pairs, 6 episodes of each" """
    study = max(run.stitches.values(), key=lambda one: len(one["pairs"]))
    counts = {kind: len(own["pairs"]) for kind, own in by_kind(study).items()}
    words = {FIRST_SKILLS: "first skill", HAND_OVERS: "pair"}
    tried = [f"{count} {words[kind]}{'s'[: count != 1]}" for kind, count in counts.items()]
    return f"{' and '.join(tried)}, {study['episodes']} episodes of each"


def _begun_where(run: Run) -> str:
    first = any(FIRST_SKILLS in by_kind(study) for study in run.stitches.values())
    return (
        f"{'Every first skill from the start of an episode, and every' if first else 'Every'} "
        "ordered pair of skills, or some of them, from where No-Stitch's first one succeeded: "
    )


def _signed(number: float, digits: int) -> str:
    return UNKNOWN if math.isnan(number) else f"{number:+.{digits}f}"


def _told(area: float) -> str:
    return UNKNOWN if math.isnan(area) else f"{area:.2f}"


def _note(text: str) -> str:
    return f'<p class="note">{escape(text)}</p>'

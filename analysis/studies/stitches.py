"""When stitching hurts: every stitch by what came of it, and what might have warned of it.

Each was played with and without from the same state, see `stitching.studies.stitches`. A stitch
to a task's first skill has "" as its "first", for it follows none.
"""

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
import pandas as pd

from analysis.run import Run
from analysis.studies.models import auc

OUTCOMES = {
    (False, True): "helped",
    (True, False): "hurt",
    (True, True): "succeeded either way",
    (False, False): "failed either way",
}
"""(the skill succeeded without, with the stitch) → its name, in the order of legends."""

WARNINGS = {
    "value_spread": "spread of values",
    "dynamics_spread": "spread of dynamics",
    "distance_end": "distance to data",
}
"""Numbers of a stitch that could have told that it hurts → their names: Eq. 2's variances first."""

FIRST_SKILLS, HAND_OVERS = "first skills", "hand-overs"
"""What is stitched: the start of an episode to a first skill, or one skill's end to the next."""

COLUMNS = [
    "part", "kind", "first", "second", "episode", "outcome", "steps", "value_start", "value_end",
    "planned", "distance_start", "distance_end", "predicted_gain", "realised_gain",
    "value_spread", "dynamics_spread",
]  # fmt: skip

Stitch = Mapping[str, Any]
Study = Mapping[str, Any]


def by_kind(study: Study) -> dict[str, Study]:
    """The study's first skills and its hand-overs, each as a study of its own, where it has any."""

    def only(first_skills: bool) -> Study:
        kept = {
            name: [one for one in study[name] if (one["first"] == "") == first_skills]
            for name in ("pairs", "stitches")
        }
        return {**study, **kept}

    kinds = {FIRST_SKILLS: only(True), HAND_OVERS: only(False)}
    return {kind: own for kind, own in kinds.items() if own["pairs"]}


def of_parts(studies: Mapping[str, Study]) -> Iterator[tuple[str, str, Study]]:
    """(part, kind, study), of every part of a run."""
    return ((part, kind, own) for part, of in studies.items() for kind, own in by_kind(of).items())


def label(part: str, kind: str) -> str:
    """ "level-1: hand-overs" """
    return f"{part}: {kind}" if part else kind


def outcome(stitch: Stitch) -> str:
    """What a stitch changed: it helped, hurt, or made no difference."""
    return OUTCOMES[stitch["succeeds_without"], stitch["succeeds_with"]]


def gains(stitch: Stitch) -> np.ndarray:
    """What the next skill's E[V] gains by each plan's first action: (plans, 2), predicted, real."""
    at = np.array([plan["step"] for plan in stitch["plans"]], dtype=np.int64)
    value = np.array(stitch["value"])
    foreseen = np.array([plan["value"] for plan in stitch["plans"]])
    return np.stack([foreseen - value[at], value[at + 1] - value[at]], axis=1)


def begun(study: Study) -> list[Stitch]:
    """Stitches of at least one step; others had their goal, no step left, or were declined."""
    return [stitch for stitch in study["stitches"] if stitch["plans"]]


def stitch_table(run: Run) -> pd.DataFrame:
    """COLUMNS, one row a stitch of at least one step.

    Gains and spreads are means over its plans' first actions; "planned" is Eq. 2 at the end of the
    first plan, as the planner saw it.
    """
    rows = [
        {
            "part": part,
            "kind": kind,
            "first": stitch["first"],
            "second": stitch["second"],
            "episode": stitch["episode"],
            "outcome": outcome(stitch),
            "steps": len(stitch["value"]) - 1,
            "value_start": stitch["value"][0],
            "value_end": stitch["value"][-1],
            "planned": stitch["plans"][0]["objective"],
            "distance_start": stitch["distance"][0],
            "distance_end": stitch["distance"][-1],
            "predicted_gain": gains(stitch)[:, 0].mean(),
            "realised_gain": gains(stitch)[:, 1].mean(),
            "value_spread": np.mean([plan["spread"] for plan in stitch["plans"]]),
            "dynamics_spread": np.mean([plan["disagreement"] for plan in stitch["plans"]]),
        }
        for part, kind, study in of_parts(run.stitches)
        for stitch in begun(study)
    ]
    return pd.DataFrame(rows, columns=COLUMNS)


def outcome_table(run: Run) -> pd.DataFrame:
    """One row a part and kind: counts, gains by a plan's first action, and what warned of hurting.

    "episodes" came to a stitch, "stitches" of them took a step; successes are those
    of the skill to come, over these episodes. Gains are means over all first actions,
    "rank_correlation" is Spearman's of predicted with realised ones. "auc_" is how likely a stitch
    that hurt had a higher value of that number than one that did not; 0.5 tells nothing, NaN where
    all or none hurt.
    """
    stitches = stitch_table(run)
    rows = [
        {
            "part": part,
            "kind": kind,
            **_counts(study),
            **_gained(study),
            **dict(_warned(stitches[(stitches["part"] == part) & (stitches["kind"] == kind)])),
        }
        for part, kind, study in of_parts(run.stitches)
    ]
    return pd.DataFrame(rows)


def _counts(study: Study) -> dict[str, Any]:
    every, outcomes = study["stitches"], [outcome(stitch) for stitch in begun(study)]
    return {
        "episodes": len(every),
        "successes_without": sum(stitch["succeeds_without"] for stitch in every),
        "successes_with": sum(stitch["succeeds_with"] for stitch in every),
        "stitches": len(outcomes),
        **{name.replace(" ", "_"): outcomes.count(name) for name in OUTCOMES.values()},
    }


def _gained(study: Study) -> dict[str, float]:
    """Of all plans' first actions."""
    pairs = np.concatenate([np.empty((0, 2)), *(gains(stitch) for stitch in begun(study))])
    frame = pd.DataFrame(pairs, columns=["predicted", "realised"])
    with np.errstate(invalid="ignore"):  # where one of them is constant there is none: NaN
        correlation = frame["predicted"].rank().corr(frame["realised"].rank())
    return {
        "plans": len(frame),
        "predicted_gain": frame["predicted"].mean(),
        "realised_gain": frame["realised"].mean(),
        "rank_correlation": correlation,
    }


def _warned(own: pd.DataFrame) -> Iterator[tuple[str, float]]:
    hurt = (own["outcome"] == "hurt").to_numpy()
    for name in WARNINGS:
        yield f"auc_{name}", auc(own[name].to_numpy(), hurt, np.zeros(len(own)))

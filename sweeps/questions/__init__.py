"""What can be asked of a setting, and the metrics that answer it; one file a question."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from orchestrator.errors import UsageError
from sweeps.questions.gain import GainQuestion
from sweeps.questions.misfit import MisfitQuestion
from sweeps.questions.question import Metric, Question

QUESTIONS: tuple[Question[Any], ...] = (GainQuestion(), MisfitQuestion())
METRICS: dict[str, Metric] = {
    name: metric for question in QUESTIONS for name, metric in question.metrics.items()
}


def question_of(metrics: Sequence[str], where: str) -> Question[Any]:
    """The question that all these metrics answer; UsageError where there is no such one."""
    if unknown := [name for name in metrics if name not in METRICS]:
        raise UsageError(f"{where}: unknown metric {unknown[0]!r}; there are {', '.join(METRICS)}")
    for question in QUESTIONS:
        if set(metrics) <= question.metrics.keys():
            return question
    together = "; ".join(", ".join(question.metrics) for question in QUESTIONS)
    raise UsageError(
        f"{where}: {' and '.join(metrics)} come from different episodes; together go {together}"
    )

"""What the data leave out."""

from __future__ import annotations

from collections.abc import Collection, Iterable

from analysis.run import Run
from analysis.schema import SEPARATOR


def undemonstrated(run: Run) -> list[str]:
    """Labels of skills that tasks ask for and no dataset accomplishes; none where that is unknown.

    A merged run, whose parts call their skills by other names, does not know.
    """
    counted = [dataset["skills"] for dataset in run.datasets if "skills" in dataset]
    if not counted:
        return []
    shown = {skill for counts in counted for skill in counts}
    tasks = (task.split(SEPARATOR) for task in run.spec.tasks)
    return [run.spec.skill_label(skill) for skill in left_out(run.spec.skills, tasks, shown)]


def left_out(
    skills: Iterable[str], tasks: Iterable[Iterable[str]], shown: Collection[str]
) -> list[str]:
    """Those of the skills, in their order, that tasks ask for and nothing shows."""
    asked = {skill for task in tasks for skill in task}
    return [skill for skill in skills if skill in asked and skill not in shown]


def undemonstrated_note(skills: list[str]) -> str:
    """A sentence for a report, or for whoever waits; "" where there is nothing to say."""
    if not skills:
        return ""
    return (
        f"No demonstration accomplishes {', '.join(skills)}: a policy cannot have learned it, and "
        "what is asked of it counts as a failure here."
    )

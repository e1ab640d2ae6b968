"""What a plan's datasets hold, as far as a store has them."""

from __future__ import annotations

from analysis.studies.data import left_out
from orchestrator.spec.structure import Plain
from orchestrator.storage.store import Artifact, Store
from orchestrator.work.plan import Plan


def datasets(plan: Plan, store: Store) -> list[Plain]:
    """What was learned from: rows, episodes, skills and content digest of each dataset."""
    listing = []
    for name, key in plan.datasets.items():
        kind = plan.recipes[key].kind
        dataset = store.read(kind, key)
        digest = store.manifest(kind, key)["digest"]
        facts = {"name": name, "key": key, "digest": digest, "skills": demonstrated(plan, dataset)}
        listing.append(facts | {k: value for k, value in dataset.info.items() if k != "format"})
    return listing


def demonstrated(plan: Plan, dataset: Artifact) -> dict[str, int]:
    """Skill → how many of a dataset's episodes accomplish it, in the order of the benchmark's."""
    accomplished = dataset.arrays["episode_skills"][dataset.arrays["episode_successes"]]
    counts = {name: int((accomplished == n).sum()) for n, name in enumerate(plan.spec.skill_names)}
    return {name: count for name, count in counts.items() if count}


def undemonstrated_skills(plan: Plan, store: Store) -> list[str]:
    """Skills of the plan's tasks that no data accomplishes of what its models are learned from.

    None while some of these are not in the store.
    """
    needed = [(plan.recipes[key].kind, key) for key in plan.datasets.values() if key in plan.needed]
    if not all(each in store for each in needed):
        return []
    datasets = [store.read(*each) for each in needed]
    shown = {skill for dataset in datasets for skill in demonstrated(plan, dataset)}
    return left_out(plan.spec.skill_names, plan.spec.all_tasks, shown)

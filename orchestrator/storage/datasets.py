"""What a plan's datasets hold, as far as a store has them."""

from __future__ import annotations

from analysis.studies.data import left_out
from orchestrator.builders.registry import BUILDERS
from orchestrator.errors import BadDataError
from orchestrator.spec.structure import Plain
from orchestrator.storage.store import Artifact, Store
from orchestrator.work.plan import Plan
from orchestrator.work.recipes import Recipe
from stitching.data.transitions import DataError


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

    None while some of these are not in the store; people's own data are read where they lie. Raises
    BadDataError where these cannot be used.
    """
    shown: set[str] = set()
    for key in plan.datasets.values():
        if key not in plan.needed:
            continue
        recipe = plan.recipes[key]
        if (recipe.kind, key) in store:
            dataset = store.read(recipe.kind, key)
        elif BUILDERS[recipe.kind].by_driver:
            dataset = own_data(recipe)
        else:
            return []
        shown |= demonstrated(plan, dataset).keys()
    return left_out(plan.spec.skill_names, plan.spec.all_tasks, shown)


def own_data(recipe: Recipe) -> Artifact:
    """People's own data, checked as a run does. Raises BadDataError saying what does not fit."""
    try:
        return BUILDERS[recipe.kind].make(recipe.params, {})
    except DataError as error:
        raise BadDataError(str(error)) from error


def check_own_data(plan: Plan, store: Store) -> None:
    """Raise BadDataError where people's own data, still to be read, cannot be used."""
    for key in plan.datasets.values():
        recipe = plan.recipes[key]
        if BUILDERS[recipe.kind].by_driver and (recipe.kind, key) not in store:
            own_data(recipe)

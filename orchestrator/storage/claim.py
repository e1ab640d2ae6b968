"""What a run directory is made for: claimed once, and checked ever after."""

from __future__ import annotations

import uuid
from collections.abc import Callable, Iterable
from contextlib import closing

from analysis.schema import PROVENANCE, QUARANTINE, SEPARATOR, SPEC
from orchestrator.benchmarks.registry import ENTRIES
from orchestrator.errors import ChangedError, UsageError
from orchestrator.spec.methods import first_method, method_label, method_of
from orchestrator.spec.origin import origin
from orchestrator.spec.spec import Spec, TableSpec, differences, plain_spec, spec_from_plain
from orchestrator.spec.structure import Plain, to_plain
from orchestrator.storage.provenance import matters
from orchestrator.storage.rundir import LEDGER, PLANNED, TRACKING, RunDirectory
from orchestrator.work.plan import Plan, make_plan

IDENTITY = "identity.json"


def spec_of(directory: RunDirectory) -> Spec:
    """The spec a directory was made for. UsageError where there is no run, or there are several."""
    if directory.is_suite:
        parts = ", ".join(str(part.path) for part in directory.parts.values())
        raise UsageError(f"{directory.path} holds several runs; name one of {parts}")
    return spec_from_plain(directory.asked()["spec"], str(directory.path / SPEC))


def claim_for_spec(directory: RunDirectory, spec: Spec) -> str:
    """Claim a directory for a spec, or check that it is the same one; returns the run's id.

    Raises ChangedError naming what differs: a field, a package version, the code.
    """
    plan = make_plan(spec)
    run_id = claim(directory, describe(spec), [plan], lambda: differences(spec_of(directory), spec))
    if (now := planned(plan)) != directory.read_json(PLANNED):
        directory.write_json(PLANNED, now)
    return run_id


def claim(
    directory: RunDirectory,
    description: Plain,
    plans: Iterable[Plan],
    differing: Callable[[], list[str]],
) -> str:
    """As `claim_for_spec`, for whatever is described; `differing` compares it with what is there.

    Its scores depend on what these plans make and play. What was claimed by a command that then
    failed, before anything was made or played, is claimed anew. Artifacts that were found in the
    store are on record, too: they bind the directory as those do that were made.
    """
    now = matters(plans)
    identity = directory.read_json(IDENTITY)
    if identity is None:
        return _claim_anew(directory, description, now)
    changed = differing()
    before = identity["matters"]
    changed += [
        f"{name}: {before.get(name)} → {now[name]}"
        for name in sorted(now)
        if before.get(name) != now[name]
    ]
    if changed and is_unused(directory):
        return _claim_anew(directory, description, now)
    if changed:
        raise ChangedError(
            f"{directory.path} was made under something else; choose another --out (finished "
            "artifacts and blocks are shared), or go back to:\n  " + "\n  ".join(changed)
        )
    return str(identity["run_id"])


def _claim_anew(directory: RunDirectory, description: Plain, now: Plain) -> str:
    """IDENTITY is deleted first and written last: a directory half claimed counts as unclaimed."""
    for name in (IDENTITY, TRACKING, PROVENANCE, QUARANTINE):
        (directory.path / name).unlink(missing_ok=True)
    directory.mark(finished=False)
    run_id = uuid.uuid4().hex
    directory.write_json(SPEC, description)
    directory.write_json(IDENTITY, {"run_id": run_id, "matters": now})
    return run_id


def refuse_sweep(directory: RunDirectory) -> None:
    """Raises UsageError where a directory holds a sweep: no run may take its place."""
    if directory.asked_sweep() is not None:
        raise UsageError(f"{directory.path} holds a sweep; choose another --out")


def is_unused(directory: RunDirectory) -> bool:
    """Whether a claimed directory has no end, block or artifact on record, parts included."""
    if directory.written:
        return False
    if directory.is_suite:
        return all(
            is_unused(part) for part in directory.parts.values() if (part.path / SPEC).is_file()
        )
    if not (directory.path / LEDGER).is_file():
        return True
    with closing(directory.ledger(read_only=True)) as ledger:
        return not ledger.finished() and not ledger.artifacts()


def planned(plan: Plan) -> Plain:
    """What `skillstitch status` counts, which should not have to plan for it."""
    artifacts = [[recipe.kind, key] for key, recipe in plan.recipes.items()]
    return {"artifacts": artifacts, "blocks": len(plan.nodes) * len(plan.chunks)}


def describe(spec: Spec) -> Plain:
    """The spec for readers of a run directory: resolved lists, and the spec itself."""
    return {
        "name": spec.name,
        "title": spec.title,
        "benchmark": spec.benchmark,
        "scale": spec.scale,
        "skills": spec.skill_names,
        "methods": [
            {
                "name": method,
                "label": method_label(method),
                "own_first_skill": bool(first_method(method, spec.rollout)),
                "models": list(method_of(method).models),
            }
            for method in spec.methods
        ],
        "seeds": list(range(spec.seeds)),
        "episodes": spec.episodes,
        "tasks": [SEPARATOR.join(task) for task in spec.all_tasks],
        "step_limits": {str(length): limit for length, limit in spec.step_limits.items()},
        "tables": [to_plain(table) | _title(spec, table) for table in spec.tables],
        "spec": plain_spec(spec),
        "origin": origin(spec),
    }


def _title(spec: Spec, table: TableSpec) -> Plain:
    """A table's title, which names its data where they are not the benchmark's usual ones."""
    label = ENTRIES[spec.benchmark].label(spec.data)
    return {"title": f"{table.title or spec.title} ({label})"} if label else {}

"""In what a run's spec differs from the packaged one of its name."""

from __future__ import annotations

import json
from typing import Any

from analysis.schema import leaves
from orchestrator.errors import UsageError
from orchestrator.spec.structure import Plain
from orchestrator.spec.tomls import packaged_specs

SYMBOLS = {"mb_stitch.alpha": "α", "mb_stitch.beta": "β"}
MOST = 3  # changes that a name tells
LONGEST = 40  # of each
UNTOLD = ("name", "title", "scale", "tables")


def changed_fields(asked: Plain) -> Plain:
    """Fields by path, and their values; none where no spec of that name is packaged.

    asked: a spec as `spec.json` has it.
    """
    if asked.get("name") not in packaged_specs():
        return {}
    from orchestrator.spec.spec import load_spec, plain_spec  # which imports torch

    try:
        usual = plain_spec(load_spec(asked["name"], asked["scale"]))
    except UsageError:  # a suite, whose parts are named after it
        return {}
    known = leaves(json.loads(json.dumps(usual)), ".")
    return {
        path: value
        for path, value in leaves(asked, ".").items()
        if path not in UNTOLD and path in known and known[path] != value
    }


def short_changes(changed: Plain) -> str:
    """ "α 5, seeds 2": for a name."""
    told = [f"{SYMBOLS.get(path, path)} {_short(value)}" for path, value in changed.items()]
    more = [f"{len(told) - MOST} more"] if len(told) > MOST else []
    return ", ".join([*(one[:LONGEST] for one in told[:MOST]), *more])


def _short(value: Any) -> str:
    if isinstance(value, list):
        return "+".join(map(_short, value))
    return f"{value:g}" if isinstance(value, float) else str(value)

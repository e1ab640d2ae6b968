"""Trials as methods with settings, so that all that they share is found in the rollout tree."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, replace

from orchestrator.spec.methods import method_name, settings_with_effect
from orchestrator.spec.spec import Spec
from sweeps.space import Fields, Value, replaced

OURS = "mb_stitch."
NO_STITCH = "no-stitch"


@dataclass(frozen=True)
class Group:
    """Candidates that share models, and first skills not stitched to; one spec plays them all."""

    spec: Spec
    methods: dict[int, str]  # place of the candidate → its method in this spec


def method_of(fields: Fields) -> str:
    """ "mb-stitch[alpha=1,cem.horizon=3]"; without a setting of its own plain "mb-stitch"."""
    settings = {
        path.removeprefix(OURS): value for path, value in fields.items() if path.startswith(OURS)
    }
    text = ",".join(f"{name}={_text(value)}" for name, value in settings.items())
    return f"mb-stitch[{text}]" if text else "mb-stitch"


def group(candidates: Sequence[Fields], base: Spec, where: str) -> list[Group]:
    """Candidates with the same fields outside the method's, together; those of the base first.

    The base's group has No-Stitch, which every candidate is compared with: under other models
    No-Stitch is another, and a gain over it could be had by worse skills.
    """
    places: dict[tuple[tuple[str, Value], ...], dict[int, str]] = defaultdict(dict)
    unchanged: tuple[tuple[str, Value], ...] = ()
    places[unchanged] = {}
    for place, fields in enumerate(candidates):
        rest = {path: value for path, value in fields.items() if not path.startswith(OURS)}
        models = replaced(base, rest, where)
        key = unchanged if models == base else tuple(rest.items())
        places[key][place] = method_of(fields)
    groups = []
    for key, methods in places.items():
        baseline = [NO_STITCH] if key == unchanged else []
        spec = replaced(base, dict(key), where)
        played = dict.fromkeys([*baseline, *methods.values()])
        groups.append(Group(replace(spec, methods=tuple(_once(played, spec))), methods))
    return [_renamed(group) for group in groups]


def _once(methods: dict[str, None], spec: Spec) -> list[str]:
    """Methods that say the same in other words (1 and 1.0), once."""
    kept: dict[str, str] = {}
    for method in methods:
        kept.setdefault(_meaning(spec, method), method)
    return list(kept.values())


def _renamed(group: Group) -> Group:
    """Every candidate under the one name that its method was kept by."""
    kept = {_meaning(group.spec, method): method for method in group.spec.methods}
    methods = {place: kept[_meaning(group.spec, method)] for place, method in group.methods.items()}
    return replace(group, methods=methods)


def _meaning(spec: Spec, method: str) -> str:
    """The same for methods that play alike."""
    settings = settings_with_effect(spec.method_settings(method))
    return f"{method_name(method)} {settings}"


def _text(value: Value) -> str:
    """As TOML and the paper write it: 1 rather than 1.0, and every other number in full."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, float) and value.is_integer() and abs(value) < 1e15:
        return str(int(value))
    return str(value)

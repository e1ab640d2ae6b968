"""Names tell in what runs of one spec differ."""

import json
from dataclasses import replace
from typing import Any

from orchestrator.spec.spec import Spec, load_spec, plain_spec
from orchestrator.spec.structure import Plain
from orchestrator.tracking.changes import changed_fields, short_changes
from tests.orchestrator.tiny import tiny_spec


def asked(spec: Spec) -> Plain:
    """As `spec.json` has it."""
    plain: Plain = json.loads(json.dumps(plain_spec(spec)))
    return plain


def test_what_is_as_packaged_has_no_changes() -> None:
    for name in ("table1", "table2", "table3-can"):
        assert changed_fields(asked(load_spec(name, "quick"))) == {}


def test_a_changed_field_is_told_in_short() -> None:
    spec: Any = load_spec("table1", "quick")
    stronger = replace(spec, mb_stitch=replace(spec.mb_stitch, alpha=5.0))
    assert changed_fields(asked(stronger)) == {"mb_stitch.alpha": 5.0}
    assert short_changes(changed_fields(asked(stronger))) == "α 5"


def test_many_changes_are_counted() -> None:
    changed = {
        "mb_stitch.beta": 0.5,
        "methods": ["no-stitch", "mb-stitch"],
        "data.source": "x" * 99,
        "seeds": 2,
        "episodes": 3,
    }
    told = short_changes(changed)
    assert told.startswith("β 0.5, methods no-stitch+mb-stitch, data.source xxx")
    assert told.endswith("x, 2 more")
    assert len(told) < 120


def test_a_spec_of_one_s_own_has_nothing_to_differ_from() -> None:
    assert changed_fields(asked(tiny_spec())) == {}
    assert changed_fields({"name": "table5", "scale": "quick", "seeds": 9}) == {}  # a suite

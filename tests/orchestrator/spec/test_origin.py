"""What is told of how a run came about: the command gives the same spec again."""

import json
from dataclasses import replace

import pytest

from analysis.schema import RunSpec
from orchestrator.spec.origin import origin
from orchestrator.spec.spec import Spec, load_spec
from orchestrator.spec.suite import Suite, load_asked, with_specs
from orchestrator.spec_commands import RunCommand, _with_spec
from orchestrator.storage.claim import describe
from orchestrator.storage.merge import describe_suite

ASKED = {
    "as packaged": ["table1"],
    "numbers": ["table1", "--scale", "smoke", "--mb-stitch.alpha", "5", "--step-limits.2", "40"],
    "lists": ["table1", "--lengths", "2", "--tasks", "g0>g1>g2", "--methods", "mb-stitch[alpha=2]"],
    "an empty list": ["table2", "--scale", "smoke", "--tasks"],
    "switches": ["table1", "--agent.clip", "--agent.no-learning-rate-decay"],
    "a dictionary": ["table2", "--data.qualities", "bottom burner", "0.5"],
    "a table": ["table2", "--tables.1.title", 'The "last" skill\'s'],
    "all parts": ["table2-levels", "--data.episodes", "40", "--seeds", "2"],
}


def asked_for(words: list[str]) -> Spec | Suite:
    _, asked = _with_spec(RunCommand, "run", words)
    return asked


@pytest.mark.parametrize("words", ASKED.values(), ids=ASKED)
def test_the_command_gives_the_same_again(words: list[str]) -> None:
    asked = asked_for(words)
    told = origin(asked)
    assert told["packaged"] == words[0]
    assert told["command"][:3] == ["skillstitch", "run", words[0]]
    assert asked_for(told["command"][2:]) == asked
    assert bool(told["changed"]) == any(
        word.startswith("--") and word != "--scale" for word in words
    )


def test_what_was_changed_is_named_with_what_it_was() -> None:
    told = origin(asked_for(ASKED["numbers"]))
    assert sorted(told["changed"]) == [["mb_stitch.alpha", 5.0, 20.0], ["step_limits.2", 40, 50]]


def test_parts_that_had_the_value_already_are_left_out() -> None:
    changed = origin(asked_for(["table2-levels", "--data.episodes", "40", "--seeds", "2"]))[
        "changed"
    ]
    assert changed == [
        ["seeds", 2, 3],
        ["10-of-quality-0.6: data.episodes", 40, 10],
        ["10-of-quality-0.9: data.episodes", 40, 10],
    ]


def test_settings_that_are_not_the_defaults_are_those_that_have_an_effect() -> None:
    """Those of methods that are not played, and of planners that do not plan, are left out."""
    told = origin(replace(load_spec("table1"), methods=("no-stitch", "mb-stitch")))
    fields = {field: (here, default) for field, here, default in told["defaults"]}
    assert fields["mb_stitch.planner"] == ("random-shooting", "cem")
    assert fields["agent.updates"] == (4000, 10000)
    assert fields["step_limits.2"] == (50, None)
    assert not any(field.startswith(("mf_stitch", "random_stitch")) for field in fields)
    assert not any("cem" in field for field in fields)
    assert not fields.keys() & {"title", "name", "scale", "tables", "agent.learning_rate"}


def test_a_file_of_somebodys_own_has_no_command() -> None:
    own = replace(load_spec("table1"), name="mine")
    told = origin(own)
    assert (told["packaged"], told["command"], told["changed"]) == ("", [], [])
    assert ["agent.updates", 4000, 10000] in told["defaults"]


def test_what_no_option_sets_has_no_command() -> None:
    spec = load_spec("table1")
    told = origin(replace(spec, step_limits={**spec.step_limits, 1: 30}))
    assert told["command"] == []
    assert told["changed"] == [["step_limits.1", 30, None]]


def test_parts_that_were_changed_apart_have_no_command() -> None:
    suite = load_asked("table2-levels")
    assert isinstance(suite, Suite)
    first, *others = (part.spec for part in suite.parts)
    told = origin(with_specs(suite, [replace(first, root_seed=1), *others]))
    assert told["command"] == []
    assert told["changed"] == [["10-of-quality-0.6: root_seed", 1, 0]]


@pytest.mark.parametrize("name", ["table1", "table2-levels"])
def test_a_run_directory_keeps_it(name: str) -> None:
    asked = load_asked(name, "quick")
    described = describe_suite(asked) if isinstance(asked, Suite) else describe(asked)
    kept = RunSpec.from_dict(json.loads(json.dumps(described))).origin
    assert kept is not None
    assert kept.packaged == name
    assert kept.command == ("skillstitch", "run", name, "--scale", "quick")
    assert kept.changed == ()
    assert len(kept.defaults) > 5

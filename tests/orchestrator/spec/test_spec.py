"""Specs: what is valid, what is refused and how, and that reading one runs nothing."""

import json
from dataclasses import replace
from pathlib import Path
from typing import get_args

import pytest

from orchestrator.errors import UsageError
from orchestrator.spec.methods import method_label
from orchestrator.spec.spec import differences, load_spec, spec_from_plain
from orchestrator.spec.structure import to_plain
from orchestrator.spec.suite import Suite, load_asked
from orchestrator.spec.tomls import Scale, packaged_specs
from stitching.methods.mb_stitch import MBStitchSettings
from stitching.planning.random_shooting import RandomShooting
from tests.sections import section, with_sections


@pytest.mark.parametrize("name", packaged_specs())
@pytest.mark.parametrize("scale", get_args(Scale))
def test_packaged_specs_load_at_every_scale(name: str, scale: Scale) -> None:
    asked = load_asked(name, scale)
    assert asked.scale == scale
    assert asked.tables
    for spec in [part.spec for part in asked.parts] if isinstance(asked, Suite) else [asked]:
        assert spec_from_plain(json.loads(json.dumps(to_plain(spec))), "copy") == spec


def test_table1_is_the_papers_protocol() -> None:
    spec = load_spec("table1")
    lengths = [len(task) for task in spec.all_tasks]
    assert [lengths.count(n) for n in (2, 3, 4)] == [12, 24, 24]
    assert (spec.episodes, spec.seeds, len(spec.methods)) == (100, 3, 4)
    assert spec.step_limits == {2: 50, 3: 50, 4: 50}
    assert (spec.agent.learning_rate, spec.agent.dropout, spec.agent.expectile) == (3e-4, 0.1, 0.7)
    settings = section(spec, MBStitchSettings)
    shooting = section(settings, RandomShooting)
    assert (shooting.population, shooting.horizon, settings.execute) == (200, 5, 5)


def test_table1s_standard_scale_is_the_papers() -> None:
    assert replace(load_spec("table1", "standard"), scale="paper") == load_spec("table1")


def test_an_unknown_spec_or_scale_lists_what_there_is(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"no spec 'table99'.*table1"):
        load_spec("table99")
    with pytest.raises(UsageError, match="no scale 'huge'; it has paper, smoke, quick, standard"):
        load_spec("table1", "huge")  # type: ignore[arg-type]
    with pytest.raises(UsageError, match="neither a file"):
        load_spec(str(tmp_path))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("name = ", "not valid TOML"),
        ("benchmark = 'chess'", "unknown benchmark 'chess'; there are maze"),
        ("benchmark = 'maze'\ntitle = ''\nalhpa = 1", "unknown field 'alhpa'; valid are name"),
        ("benchmark = 'maze'\nname = 'x'\ntitle = ''", "no tasks"),
        ("benchmark='maze'\nname='x'\ntitle=''\ntasks=['g0>g9']", "no skill 'g9'; it has g0"),
        ("benchmark='maze'\nname='x'\ntitle=''\ntasks=['g0>g1']", r"none for tasks of 2 skills"),
    ],
)
def test_a_broken_file_is_refused_naming_it(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "mine.toml"
    path.write_text(text)
    with pytest.raises(UsageError, match=rf"(?s)(mine\.toml|spec x).*{message}"):
        load_spec(str(path))


SOUND = "benchmark='maze'\nname='x'\ntitle=''\ntasks=['g0>g1']\nstep_limits={2=50}\n"
SOUND += "methods=['no-stitch']\n"
MF = SOUND.replace("no-stitch", "mf-stitch") + "[mf_stitch]\n"


def test_a_base_gives_what_a_file_leaves_open(tmp_path: Path) -> None:
    (tmp_path / "sound.toml").write_text(SOUND + "[agent]\nwidth = 9\n[scales.smoke]\nseeds = 1")
    (tmp_path / "mine.toml").write_text("base='sound'\nname='y'\n[agent]\nmembers = 2")
    base, mine = (load_spec(str(tmp_path / f"{name}.toml"), "smoke") for name in ("sound", "mine"))
    assert mine == replace(base, name="y", agent=replace(base.agent, members=2))
    assert (mine.seeds, mine.agent.width) == (1, 9)


def test_a_base_must_be_another_spec(tmp_path: Path) -> None:
    (tmp_path / "ours.toml").write_text("base='mine'")
    for base, complaint in {
        "table3": "its base table3 is itself a suite",
        "mine": "its base mine is based on it",
        "ours": "its base mine is based on it",
        "gone": "no spec 'gone'",
    }.items():
        (tmp_path / "mine.toml").write_text(f"base='{base}'")
        with pytest.raises(UsageError, match=complaint):
            load_spec(str(tmp_path / "mine.toml"))


def test_the_spec_below_is_sound(tmp_path: Path) -> None:
    (tmp_path / "mine.toml").write_text(SOUND)
    assert load_spec(str(tmp_path / "mine.toml")).all_tasks == [("g0", "g1")]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            SOUND + "[agent]\nlearning_rate = nan",
            "agent, learning_rate: must be a finite number: nan",
        ),
        (SOUND + "[agent]\nbatch_size = 0", "agent, batch_size: must be at least 1"),
        (SOUND + "[agent]\ngamma = 2.0", "agent, gamma: must be at most 1: 2.0"),
        (SOUND + "[agent]\ndropout = 1.0", "agent, dropout: must be below 1: 1.0"),
        (SOUND + "[data]\nepisodes = 0", "data, episodes: must be at least 1"),
        (SOUND + "[dynamics]\nactivation = 'tanh'", "activation"),
        (
            SOUND + "[mb_stitch.cem]\npopulation = 5\nelites = 9",
            "cem, elites: must be at most the population, 5: 9",
        ),
        (SOUND + "[data]\nnoise = -inf", "data, noise: must be a finite number: -inf"),
        (SOUND.replace("no-stitch", "mb-stitch[beta=inf]"), "beta: must be a finite number: inf"),
        (SOUND.replace("2=50", "2=0"), "step_limits, 2: must be at least 1"),
        (SOUND + "scales = ['paper']", "scales: expected a table"),
        (SOUND + "scales.paper = 3", "scales: expected a table"),
        (SOUND + "[scales.quik]", "no scale 'quik'; there are smoke, quick, standard, paper"),
        (SOUND.replace("'maze'", "['maze']"), r"unknown benchmark \['maze'\]; there are maze"),
        (SOUND.replace("''", "1979-05-27"), "title: expected str"),
        (SOUND + "# \udcff", "not valid TOML"),
        (SOUND + "rollout = " + 9999 * "[", "not valid TOML"),
        (MF + "mixture = 'both'", "mixture: 'both' is not one of halves, joined"),
        (MF + "training.policy_width = 7", r"layers of \[7, 7\] cannot be fine-tuned from"),
        (MF + "[agent]\nmulti_task = false", "fine-tuned pair by pair; set multi_task"),
        (SOUND + "agent.swap = 0.5", "agent: what maze shows does not tell its robot"),
        (SOUND + "agent.corrections = 1.5", "agent: what maze shows does not tell its robot"),
        (SOUND + "agent.swap = 1.5", "agent, swap: must be at most 1: 1.5"),
        (MF + "training.swap = 0.5", "mf-stitch, training: only the agent learns with swap"),
        (
            SOUND.replace("no-stitch", "mf-stitch[training.swap=0.5]"),
            "only the agent learns with swap",
        ),
        (SOUND.replace("'x'", "'..'"), r"'\.\.' is no name"),
        (SOUND.replace("'x'", "'a/../../b'"), "'a/../../b' is no name"),
        (SOUND.replace("'x'", "'/etc/x'"), "'/etc/x' is no name"),
        (SOUND.replace("'x'", '"x\\u0000"'), "is no name"),
        (SOUND + "[[tables]]\nid = '../../x'\npaper = '1'", r"'\.\./\.\./x' is no name"),
        (SOUND + "[[tables]]\nid = 'x'\npaper = '1'\nrows = 'odd'", "no rows 'odd'; there are"),
    ],
)
def test_what_cannot_be_carried_out_is_refused_at_once(
    tmp_path: Path, text: str, message: str
) -> None:
    path = tmp_path / "mine.toml"
    path.write_bytes(text.encode(errors="surrogateescape"))
    with pytest.raises(UsageError, match=rf"(?s)(mine\.toml|spec ).*{message}"):
        load_spec(str(path))


@pytest.mark.parametrize(
    "bait",
    [
        "__import__('pathlib').Path('{}').touch()",
        "!!python/object/apply:os.system ['touch {}']",
        "$(touch {})",
        "cposix\nsystem\n(S'touch {}'\ntR.",
    ],
)
def test_a_malicious_spec_runs_nothing(tmp_path: Path, bait: str) -> None:
    touched, path = tmp_path / "touched", tmp_path / "mine.toml"
    value = json.dumps(bait.format(touched))
    path.write_text(f"benchmark = 'maze'\nname = {value}\ntitle = {value}\nmethods = [{value}]\n")
    with pytest.raises(UsageError):
        load_spec(str(path))
    assert not touched.exists()


def test_methods_take_settings() -> None:
    spec = load_spec("table1")
    settings = spec.method_settings("mb-stitch[alpha=1,beta=2.5,norm=max]")
    assert isinstance(settings, MBStitchSettings)
    assert (settings.alpha, settings.beta, settings.norm) == (1.0, 2.5, "max")
    usual = section(spec, MBStitchSettings)
    assert section(settings, RandomShooting) == section(usual, RandomShooting)
    assert method_label("mb-stitch[alpha=1,beta=2.5]") == "MB-Stitch [alpha=1,beta=2.5]"


@pytest.mark.parametrize(
    ("method", "message"),
    [
        ("mb-stich", "unknown method 'mb-stich'; there are no-stitch, random-stitch"),
        (
            "mb-stitch[alhpa=1]",
            "unknown field 'alhpa'; valid are planner, execute, limit",
        ),
        ("mb-stitch[alpha=big]", "alpha: expected float"),
        ("mb-stitch[alpha=1", "write name or name"),
        ("mb-stitch[planner=magic]", "'magic' is not one of random-shooting, cem"),
    ],
)
def test_an_unknown_method_or_setting_lists_what_there_is(method: str, message: str) -> None:
    with pytest.raises(UsageError, match=message):
        replace(load_spec("table1"), methods=(method,))


def test_differences_name_the_fields() -> None:
    spec = load_spec("table1")
    changed = with_sections(
        replace(spec, seeds=4), replace(section(spec, MBStitchSettings), alpha=3.0)
    )
    assert differences(spec, changed) == ["mb_stitch.alpha: 20.0 → 3.0", "seeds: 3 → 4"]
    assert differences(spec, spec) == []

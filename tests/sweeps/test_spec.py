"""What can be asked for, and how what cannot is refused."""

import re
from pathlib import Path
from typing import Any, get_args

import pytest

from analysis.paper.numbers import paper_scores
from analysis.schema import RunSpec
from analysis.tables.rows import place_tasks
from orchestrator.errors import UsageError
from orchestrator.spec.spec import TableSpec, load_spec
from orchestrator.spec.tomls import Scale
from orchestrator.storage.claim import describe
from stitching.methods.mb_stitch import MBStitchSettings
from sweeps.costs import plan_lines
from sweeps.results.table import table_spec
from sweeps.space import Dimension, replaced
from sweeps.spec import (
    Confirm,
    Pruner,
    base_spec,
    load_sweep,
    packaged_sweeps,
    split_tasks,
)
from tests.sections import section
from tests.sweeps.tiny import tiny_sweep

ROOT = Path(__file__).parents[2]
ALPHA = "mb_stitch.alpha"
OWN = {ALPHA: 1.0, "mb_stitch.beta": 1.0, "mb_stitch.random_shooting.population": 4}
"""A setting within the tiny sweep's space."""


@pytest.mark.parametrize("scale", get_args(Scale))
@pytest.mark.parametrize("name", packaged_sweeps())
def test_packaged_sweeps_can_be_asked_for(name: str, scale: Scale) -> None:
    sweep = load_sweep(name, scale)
    assert (sweep.name, sweep.scale) == (name, scale)


def test_table9_is_the_papers_grid() -> None:
    sweep = load_sweep("table9")
    pairs = [tuple(point.values()) for point in sweep.points]
    assert pairs == [(a, b) for a in (1, 10, 20) for b in (1, 10, 20)]
    assert base_spec(sweep).seeds == 3
    assert len(split_tasks(sweep, base_spec(sweep))[0]) == 3


def test_a_search_in_kitchen_sees_some_of_its_pairs() -> None:
    sweep = load_sweep("kitchen-search", "quick")
    searched, held_out = split_tasks(sweep, base_spec(sweep))
    assert (len(searched), len(held_out)) == (12, 14)
    assert set(searched) <= set(split_tasks(load_sweep("kitchen-search"), base_spec(sweep))[0])
    assert sweep.budget == 40
    assert len(sweep.space) == 6


@pytest.mark.parametrize(
    ("path", "dimension", "message"),
    [
        (
            "mb_stitch.gamma",
            Dimension(low=0.1, high=1.0),
            "unknown field 'gamma'; valid are planner, execute, limit",
        ),
        ("mb_stich.alpha", Dimension(low=0.1, high=1.0), "begin with one of mb_stitch, agent"),
        ("episodes", Dimension(low=1, high=9), "'episodes' cannot be searched"),
        (ALPHA, Dimension(low=2.0, high=1.0), "low must be below high: 2.0, 1.0"),
        (ALPHA, Dimension(low=0.0, high=1.0, log=True), "logarithmic range needs low > 0"),
        (ALPHA, Dimension(low=1.0), "give choices = […], or low and high"),
        (ALPHA, Dimension(choices=(1,), low=1), "not both"),
        (ALPHA, Dimension(choices=("much",)), "expected float, got 'much'"),
        ("mb_stitch.norm", Dimension(choices=("l3",)), "'l3' is not one of mean, l2, max"),
        ("mb_stitch.limit", Dimension(low=0.5, high=2.5), "expected int, got 0.5"),
        ("mb_stitch.limit", Dimension(low=0.5, high=2, integer=True), "must be whole: 0.5, 2"),
    ],
)
def test_a_bad_space_is_named(path: str, dimension: Dimension, message: str) -> None:
    with pytest.raises(UsageError) as refused:
        tiny_sweep(space={path: dimension})
    assert message in str(refused.value)


def test_fields_that_do_not_go_together_are_found_before_anything_runs() -> None:
    space = {
        "mb_stitch.cem.population": Dimension(low=5, high=50, integer=True),
        "mb_stitch.cem.elites": Dimension(low=2, high=10, integer=True),
    }
    with pytest.raises(UsageError, match=r"cem\.elites = 10.*elites: must be at most the"):
        tiny_sweep(space=space)
    # Whatever the base's own values are: only the space's count.
    fitting = Dimension(low=2, high=5, integer=True)
    tiny_sweep(space=space | {"mb_stitch.cem.elites": fitting})


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"trials": 0}, "trials: must be at least 1"),
        ({"objectives": ("gain", "gain")}, "each once"),
        ({"constraints": {"seconds": 1.0}}, "unknown metric 'seconds'; there are gain, score"),
        ({"objectives": ("gain", "imagined"), "pruner": Pruner(rounds=2)}, "works with one"),
        ({"held_out_share": 0.5}, "not both"),
        ({"held_out": ("g1>g0>g2",)}, "begins like a task of the search"),
        ({"tasks": ("g0>g9",)}, "has no skill 'g9'"),
        ({"confirm": Confirm(seeds=(0,))}, "the search itself uses seed 0"),
        ({"base": "table0"}, "no spec 'table0'"),
        ({"settings": {"sedes": 2}}, "unknown field 'sedes'"),
        ({"sampler": "grid"}, "a grid needs choices"),
        ({"space": {}}, "nothing to search"),
        (
            {"enqueued": ({ALPHA: 1.0},)},
            "enqueued, 0: expected a value for each of mb_stitch.alpha",
        ),
        ({"enqueued": (OWN, OWN | {"seed": 1})}, "enqueued, 1: expected a value for each of"),
        ({"enqueued": (OWN, OWN | {ALPHA: 99.0})}, "1, mb_stitch.alpha: 99.0 is outside its range"),
        ({"enqueued": (OWN | {ALPHA: "much"},)}, "'much' is outside its range"),
        ({"sampler": "grid", "enqueued": (OWN,)}, "enqueued: a grid has its own order"),
    ],
)
def test_what_cannot_be_carried_out_is_refused(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(UsageError) as refused:
        tiny_sweep(**changes)
    assert message in str(refused.value)


def test_an_unknown_sweep_and_an_unknown_field_are_named(tmp_path: Path) -> None:
    every = "kitchen-data, kitchen-search, maze-alpha-beta, table9"
    with pytest.raises(UsageError, match=f"nor one of {every}"):
        load_sweep("table99")
    file = tmp_path / "mine.toml"
    file.write_text('name = "mine"\nbatches = 3\n')
    with pytest.raises(UsageError, match="unknown field 'batches'; valid are name, title"):
        load_sweep(str(file))
    file.write_text("name = ")
    with pytest.raises(UsageError, match="not valid TOML"):
        load_sweep(str(file))


def test_held_out_tasks_begin_unlike_the_search_s() -> None:
    sweep = tiny_sweep(
        tasks=(), held_out=(), held_out_share=0.25, settings={"tasks": [], "lengths": [2, 3]}
    )
    searched, held_out = split_tasks(sweep, base_spec(sweep))
    assert len(searched) + len(held_out) == 36
    assert len(held_out) == 9  # 3 of 12 pairs, each with two third skills
    assert not {task[:2] for task in searched} & {task[:2] for task in held_out}


def test_a_grid_over_numbers_is_evenly_laid() -> None:
    assert Dimension(low=1, high=100, log=True, points=3).grid("") == [1.0, 10.0, 100.0]
    assert Dimension(low=0, high=4, integer=True, points=3).grid("") == [0, 2, 4]
    assert Dimension(choices=("mean", "l2")).grid("") == ["mean", "l2"]


def test_methods_take_settings_of_their_planner() -> None:
    """What makes a trial a method: dots lead into fields of fields."""
    spec = load_spec("table2")
    own = replaced(spec, {"mb_stitch.cem.horizon": 3, "mb_stitch.alpha": 2}, "")
    settings = spec.method_settings("mb-stitch[alpha=2,cem.horizon=3]")
    assert settings == section(own, MBStitchSettings)
    with pytest.raises(UsageError, match="unknown field 'horizons'"):
        spec.method_settings("mb-stitch[cem.horizons=3]")


def test_every_cell_of_table9_stands_beside_the_paper_s() -> None:
    run = RunSpec.from_dict(describe(table_spec(load_sweep("table9"))))
    places = place_tasks(run, run.tables[0])
    ours = set(zip(places["row"], places["column"], strict=True))
    assert ours == set(paper_scores("9"))
    assert len(ours) == 3 * 10


def test_a_table_compares_methods_and_not_models() -> None:
    space = {"dynamics.updates": Dimension(choices=(30, 60))}
    table = TableSpec("mine", paper="", rows="task")
    with pytest.raises(UsageError, match="a table compares methods, not models"):
        tiny_sweep(sampler="grid", space=space, tables=(table,))


@pytest.mark.parametrize("scale", get_args(Scale))
def test_the_example_of_the_documentation_can_be_planned(scale: Scale, tmp_path: Path) -> None:
    """As it is written, at every scale of its base."""
    text = (ROOT / "docs" / "sweeps.md").read_text()
    example, _ = re.findall(r"```toml\n(.*?)```", text, flags=re.DOTALL)
    (tmp_path / "burners.toml").write_text(example)
    sweep = load_sweep(str(tmp_path / "burners.toml"), scale)
    head, *others = plan_lines(sweep, tmp_path / "store")
    assert head.startswith(f"burners at {scale} scale: {4 if scale == 'smoke' else 40} trials")
    assert len(others) == 2
    assert base_spec(sweep).scale == scale


def test_a_sweep_has_the_scales_of_its_base(tmp_path: Path) -> None:
    own = '[space]\n"mb_stitch.alpha" = { choices = [1, 2] }\n'
    path = tmp_path / "own.toml"
    path.write_text(f'name = "own"\ntitle = "Own"\nbase = "table1"\nsampler = "grid"\n{own}')
    quick = base_spec(load_sweep(str(path), "quick"))
    assert quick.agent.updates == load_spec("table1", "quick").agent.updates
    (tmp_path / "base.toml").write_text('benchmark = "maze"\nname = "a"\ntitle = "A"\n')
    path.write_text(path.read_text().replace("table1", "base.toml"))
    with pytest.raises(UsageError, match=r"base\.toml: no scale 'quick'; it has paper"):
        load_sweep(str(path), "quick")

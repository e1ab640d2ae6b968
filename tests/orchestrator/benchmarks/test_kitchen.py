"""A small Kitchen reproduction from data to report, with skills that really work."""

import json
import shutil
from dataclasses import replace
from itertools import pairwise, permutations

import pandas as pd
import pytest

from orchestrator.printing import forecast_lines
from orchestrator.spec.spec import Spec, load_spec
from orchestrator.storage.store import Store
from orchestrator.work.plan import Plan, make_plan
from stitching.data.kitchen.demonstrations import KitchenDataConfig
from stitching.data.kitchen.segments import Order
from stitching.methods.mb_stitch import MBStitchSettings
from stitching.methods.mf_stitch import MFStitchSettings
from stitching.methods.random_stitch import RandomStitchSettings
from stitching.methods.single_policy import SinglePolicySettings
from stitching.models.dynamics import DynamicsConfig
from stitching.models.iql import IQLConfig
from stitching.planning.cem import CEM
from stitching.studies.stitches import START
from tests.orchestrator.tiny import Alone, Place
from tests.sections import fields_of, section, with_sections

ORDER: Order = ("microwave", "kettle", "bottom burner", "slide cabinet")
METHODS = ("no-stitch", "random-stitch", "mf-stitch", "mb-stitch", "single-policy")

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def spec() -> Spec:
    """One order and what it is cut into, learned well enough to go four skills deep."""
    spec = load_spec("table2", "smoke")
    skills = IQLConfig(
        updates=3000, learning_rate=1e-3, dropout=0.0, members=2, width=32,
        policy_width=256, policy_layers=2, log_every=1000,
    )  # fmt: skip
    sections = fields_of(
        spec,
        replace(section(spec, RandomStitchSettings), limit=3),
        replace(section(spec, MFStitchSettings), limit=3, training=replace(skills, updates=100)),
        SinglePolicySettings(">".join(ORDER), episodes=12, training=skills),
        with_sections(
            replace(section(spec, MBStitchSettings), limit=3),
            CEM(population=16, elites=4, iterations=10),
        ),
    )
    return replace(
        spec,
        methods=METHODS,
        lengths=(),
        tasks=(">".join(ORDER[:3]), ">".join(ORDER), ">".join(ORDER[2:])),
        episodes=4,
        block_episodes=4,
        rollout=replace(spec.rollout, temperature=0.0, first_stitch=False),
        data=KitchenDataConfig(episodes=12, held_out=1, quality=0.9),  # steady demonstrators
        agent=skills,
        dynamics=DynamicsConfig(updates=300, width=32, members=2, activation="elu"),
        **sections,
    )


def carried_out(spec: Spec, place: Place) -> tuple[Plan, Place]:
    with pytest.MonkeyPatch.context() as patch:
        for module in ("orchestrator.benchmarks.kitchen", "stitching.data.kitchen.demonstrations"):
            patch.setattr(f"{module}.orders", lambda config: (ORDER,))
        place.carry_out(spec)
        return make_plan(spec), place


@pytest.fixture(scope="module")
def played(spec: Spec, tmp_path_factory: pytest.TempPathFactory) -> tuple[Plan, Place]:
    return carried_out(spec, Place(tmp_path_factory.mktemp("kitchen")))


@pytest.fixture(scope="module")
def stitched_first(
    spec: Spec, played: tuple[Plan, Place], tmp_path_factory: pytest.TempPathFactory
) -> tuple[Plan, Place]:
    """Two skills by the same models, stitched to from the first one on."""
    place = Place(tmp_path_factory.mktemp("first"))
    shutil.copytree(played[1].store_root, place.store_root)
    rollout = replace(spec.rollout, first_stitch=True)
    return carried_out(replace(spec, tasks=(">".join(ORDER[:2]),), rollout=rollout), place)


@pytest.mark.parametrize("method", METHODS)
def test_long_tasks_played_without_the_tree(played: tuple[Plan, Place], method: str) -> None:
    plan, place = played
    depths = [
        Alone(plan, place, 0, method, task, chunk=0).depth_of_the_same_bytes()
        for task in plan.spec.all_tasks
    ]
    assert max(depths) >= 3


def test_the_run_tells_of_pairs_and_models(played: tuple[Plan, Place]) -> None:
    plan, place = played
    pairs = pd.read_csv(place.out / "report" / "pairs.csv")
    shown = pairs[pairs["in_data"]]
    known = set(zip(shown["first"], shown["second"], strict=True))
    assert known <= set(pairwise(ORDER))
    diagnosis = json.loads((place.out / "diagnosis.json").read_text())
    assert diagnosis["competence"].keys() == set(ORDER)
    foretold = {(pair["first"], pair["second"]) for pair in diagnosis["forecast"]}
    assert foretold == set(permutations(ORDER, 2))
    told = list(forecast_lines(plan, Store(place.store_root)))
    assert {line.split("  ")[1] for line in told[2:]} == set(ORDER)
    assert all(skill["rank_correlation"] > 0.8 for skill in diagnosis["values"].values())
    assert diagnosis["predictions"]["5"]["groups"]["arm positions"]["relative"] < 1
    for table in ("table2", "table8"):
        assert (place.out / "report" / f"{table}.md").is_file()


@pytest.mark.parametrize("method", METHODS)
def test_first_stitches_played_without_the_tree(
    stitched_first: tuple[Plan, Place], method: str
) -> None:
    plan, place = stitched_first
    (task,) = plan.spec.all_tasks
    alone = Alone(plan, place, 0, method, task, chunk=0)
    assert alone.depth_of_the_same_bytes() >= 1
    stitched = alone.recorded()[0].arrays["stitch_steps"].any()
    assert stitched == (method in ("random-stitch", "mb-stitch"))


def test_stitches_are_taken_apart(stitched_first: tuple[Plan, Place]) -> None:
    plan, place = stitched_first
    study = json.loads((place.out / "stitches.json").read_text())
    taken = [(pair["first"], pair["second"]) for pair in study["pairs"]]
    pairs = list(dict.fromkeys(p for task in plan.spec.all_tasks for p in pairwise(task)))
    assert [pair for pair in taken if pair[0] != START] == pairs
    assert {pair for pair in taken if pair[0] == START} == {(START, first) for first, _ in pairs}
    stitched = pd.read_parquet(place.out / "segments.parquet").query(
        "depth == 1 and method == 'mb-stitch'"
    )
    played_there = stitched.set_index(["prefix", "episode"])
    compared = 0
    for stitch in study["stitches"]:
        place_in_tree = stitch["second"], stitch["episode"]
        if stitch["first"] == START and place_in_tree in played_there.index:
            there = played_there.loc[place_in_tree]
            assert stitch["succeeds_with"] == there["success"]
            assert stitch["steps_with"] == there["steps"]
            compared += 1
    assert compared


def test_a_shown_episode_is_recorded_step_by_step(played: tuple[Plan, Place]) -> None:
    _, place = played
    showcase = json.loads((place.out / "showcase.json").read_text())
    for episode in showcase["episodes"]:
        lengths = {len(episode[name]) for name in ("positions", "skill", "phase", "value")}
        assert len(lengths) == 1
        assert {len(at) for at in episode["positions"]} == {30}
    stitched = showcase["episodes"][-1]
    if stitched["accomplished"]:
        assert "stitch" in stitched["phase"]

"""A sweep over data, judged by the unstitched skills alone; what is played is made up here."""

import json
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pandas as pd
import pytest

from analysis.episodes import episodes_from_segments
from analysis.paper.implied import bounds
from analysis.schema import RunSpec
from orchestrator.errors import UsageError
from orchestrator.spec.methods import first_method
from orchestrator.spec.spec import Spec, load_spec
from orchestrator.storage.claim import describe
from orchestrator.work.plan import make_plan
from orchestrator.work.progress import Silent
from stitching.data.kitchen.demonstrations import KitchenDataConfig
from sweeps.costs import plan_lines
from sweeps.player import PlayedSpec, SpecPlayer
from sweeps.search import search_spec
from sweeps.space import Dimension
from sweeps.spec import Confirm, Pruner, SweepSpec, load_sweep
from sweeps.sweep import carry_out
from sweeps.winner import with_winner
from tests.sweeps.tiny import settings

QUALITY, BEST = "data.quality", 0.7
SPACE = {QUALITY: Dimension(choices=(0.9, BEST, 0.3)), "data.ease": Dimension(choices=(0, 8))}


def data_sweep(**changes: Any) -> SweepSpec:
    return replace(load_sweep("kitchen-data", "smoke"), **{"enqueued": (), **changes})


def made_up(self: SpecPlayer, spec: Spec, seeds: Iterable[int] | None = None) -> PlayedSpec:
    """Skills as the paper's tables imply them where quality is BEST, and further off elsewhere."""
    seeds = tuple(range(spec.seeds) if seeds is None else seeds)
    assert isinstance(spec.data, KitchenDataConfig)
    off = abs(spec.data.quality - BEST)
    rows = []
    for method in spec.methods:
        implied = bounds(method).set_index(["kind", "skill"]).mean(axis=1)
        for first, *rest in sorted({task[:depth] for task in spec.all_tasks for depth in (1, 2)}):
            rate = implied["first", first]
            owner, prefix = first_method(method, spec.rollout), first
            if rest:  # given the first: both succeed as often as implied, where they can
                rate = implied["second", rest[0]] / max(rate, 1e-9)
                owner, prefix = method, f"{first}>{rest[0]}"
            for seed in seeds:
                for episode in range(spec.episodes):
                    works = episode < round((min(1.0, rate) * (1 - off)) * spec.episodes)
                    rows.append((seed, owner, prefix, len(rest) + 1, episode, works, 60))
    columns = ["seed", "method", "prefix", "depth", "episode", "success", "end_step"]
    segments = pd.DataFrame(rows, columns=columns).drop_duplicates(columns[:5])
    run = replace(RunSpec.from_dict(describe(spec)), seeds=seeds)
    return PlayedSpec(segments, episodes_from_segments(segments, run), run)


@pytest.fixture(scope="module")
def found(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A whole grid over data, figures included."""
    root = tmp_path_factory.mktemp("data-sweep")
    sweep = data_sweep(
        sampler="grid", space=SPACE, confirm=Confirm(best=2), settings=settings_of(20)
    )
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(SpecPlayer, "prepare", lambda *_: None)
        patched.setattr(SpecPlayer, "play", made_up)
        carry_out(sweep, settings(root), Silent(), root / "results")
    return root / "sweep"


def settings_of(episodes: int) -> dict[str, Any]:
    return load_sweep("kitchen-data", "smoke").settings | {"episodes": episodes}


def test_the_setting_nearest_to_the_paper_wins(found: Path) -> None:
    winner = json.loads((found / "winner.json").read_text())
    trials = json.loads((found / "trials.json").read_text())
    assert winner["fields"] == {QUALITY: BEST, "data.ease": 0}
    assert len(trials) == 6
    assert winner["search"]["misfit"] == min(trial["misfit"] for trial in trials)
    for trial in trials:
        parts = (trial["first"] + trial["second"]) / 2 + trial["cells"]
        assert trial["misfit"] == pytest.approx(parts)
        assert set(trial["profile"]) == {"no-stitch", "random-stitch"}
        assert len(trial["profile"]["no-stitch"]["first"]) == 8  # seven and their mean
    assert with_winner(load_spec("table2", "smoke"), str(found)).data.quality == BEST


def test_the_winner_is_played_again_by_new_seeds_beside_the_base(found: Path) -> None:
    confirmed = json.loads((found / "confirm.json").read_text())
    assert confirmed["seeds"] == [1]
    assert [row["fields"][QUALITY] for row in confirmed["trials"]] == [BEST, BEST]
    assert confirmed["trials"][0]["search_misfit"] == confirmed["trials"][0]["misfit"]
    assert confirmed["base"]["misfit"] > confirmed["trials"][0]["misfit"]


def test_the_report_shows_profiles_beside_the_paper_s(found: Path) -> None:
    report = (found / "report" / "index.md").read_text()
    assert "| No-Stitch | first | microwave | 0.697 to 1.000 |" in report
    assert "| Random-Stitch | second | mean | 0.028 to 0.117 |" in report
    assert "the winner's misfit is" in report.lower()
    assert "| paper | – | – | – | – | – | – | 0.224 | 0.123 |" in report
    table = pd.read_csv(found / "report" / "trials.csv")
    assert {"data.quality", "misfit", "profile no-stitch first microwave"} <= set(table.columns)
    figures = {path.name for path in (found / "report" / "figures").glob("*.svg")}
    assert figures == {"history.svg", "importances.svg", "slices.svg"}


def test_nothing_is_planned_that_neither_method_needs() -> None:
    plan = make_plan(search_spec(data_sweep()))
    assert plan.spec.methods == ("no-stitch", "random-stitch")
    assert not plan.by_seed("dynamics")
    assert not plan.illustrations
    assert {plan.recipes[key].kind for key in plan.needed} == {"kitchen-demonstrations", "agent"}
    assert len(plan.nodes) == 2 * (7 + 42)


def test_the_plan_says_what_a_trial_trains(tmp_path: Path) -> None:
    head, trial = plan_lines(data_sweep(), tmp_path)
    assert "2 trials × 42 tasks" in head
    assert "at most 98 blocks; the base's own setting has 0 of 17 artifacts and 0 of 98" in trial


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"tasks": ("kettle>microwave",)}, "a misfit is of all pairs of Kitchen's skills"),
        ({"held_out_share": 0.2}, "hold nothing out"),
        ({"base": "table1", "settings": {"lengths": [2]},
          "space": {"data.episodes": Dimension(low=1, high=9, integer=True)}},
         "a misfit is of all pairs of Kitchen's skills"),
        ({"space": {"mb_stitch.alpha": Dimension(low=1, high=2)}}, "begin with one of data, agent"),
        ({"objectives": ("misfit", "gain")}, "misfit and gain come from different episodes"),
        ({"constraints": {"imagined": 1.0}}, "come from different episodes"),
        ({"objectives": ("distance",)}, "unknown metric 'distance'; there are gain, score"),
        ({"pruner": Pruner(rounds=2)}, "make gain or score the objective"),
        ({"space": {"data.qualities.oven": Dimension(low=0.1, high=0.9)}}, "no skill 'oven'"),
    ],
)  # fmt: skip
def test_what_has_no_misfit_is_refused(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(UsageError) as refused:
        data_sweep(**changes)
    assert message in str(refused.value)


def test_a_skill_s_own_quality_can_be_searched() -> None:
    """The base has none for it, so that its own setting is not among the trials."""
    path = "data.qualities.slide cabinet"
    sweep = data_sweep(space={path: Dimension(low=0.1, high=0.9)})
    assert sweep.space[path].ends == (0.1, 0.9)

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from analysis.run import load_run
from analysis.studies.models import auc, model_table
from tests.analysis.kitchen_run import SKILLS, kitchen_segments, write_kitchen
from tests.rows import row


def brute_force(values: np.ndarray, success: np.ndarray, seeds: np.ndarray) -> float:
    wins = [
        0.5 * (a == b) + (a > b)
        for a, won, seed in zip(values, success, seeds, strict=True)
        for b, also, other in zip(values, success, seeds, strict=True)
        if won and not also and seed == other
    ]
    return float(np.mean(wins))


@pytest.mark.parametrize("trial", range(5))
def test_auc_is_the_share_of_pairs_in_the_right_order(trial: int) -> None:
    rng = np.random.default_rng(trial)
    values = rng.integers(0, 5, 40).astype(np.float32)  # with many ties
    success, seeds = rng.random(40) < 0.3, rng.integers(0, 3, 40)
    assert auc(values, success, seeds) == pytest.approx(brute_force(values, success, seeds))


def test_auc_needs_both_outcomes_of_one_seed() -> None:
    values, seeds = np.array([1.0, 2.0]), np.array([0, 1])
    assert np.isnan(auc(values, np.array([True, True]), seeds))
    assert np.isnan(auc(values, np.array([True, False]), seeds))
    assert auc(values, np.array([False, True]), np.array([0, 0])) == 1.0


def test_all_models_are_in_the_table(tmp_path: Path, write_run: Callable[..., Path]) -> None:
    run = load_run(write_kitchen(write_run, tmp_path / "run"))
    table = model_table(run).set_index(["measure", "of"])
    assert table.loc["competence"].index.tolist() == SKILLS
    assert table.loc[("competence", "kettle"), "value"] == pytest.approx(0.97)
    assert row(table, "from start pose", "kettle")[["successes", "trials"]].tolist() == [8, 8]
    assert table.loc[("value rank correlation", "kettle"), "trials"] == 3
    assert table.loc[("relative error after 5", "arm positions"), "value"] == 0.2
    assert table.loc[("disagreement rank correlation after 1", "all"), "value"] == 0.7

    plain = kitchen_segments().query("method == 'no-stitch' and prefix.str.endswith('>kettle')")
    assert table.loc[("after other skills", "kettle"), "successes"] == plain["success"].sum()
    expected = brute_force(*(plain[name].to_numpy() for name in ("value_start", "success", "seed")))
    assert table.loc[("auc", "kettle"), "value"] == pytest.approx(expected)
    assert pd.isna(row(table, "auc", "microwave")["value"])  # it never succeeds second

"""What a candidate's episodes come to."""

from dataclasses import replace
from typing import cast

import pandas as pd

from orchestrator.spec.spec import load_spec
from stitching.methods.mb_stitch import MBStitchSettings
from sweeps.scoring import MeasuredGain


def test_an_interval_is_about_other_tasks_too() -> None:
    """Of two families one always gains and the other never does: nobody knows of a third."""
    tasks = ["g0>g1", "g1>g0>g2"]
    baseline = pd.DataFrame(
        {"seed": 0, "task": task, "episode": range(6), "length": task.count(">") + 1,
         "accomplished": 0}
        for task in tasks
    ).explode("episode")  # fmt: skip
    gains = baseline["length"].where(baseline["task"] == tasks[0], 0)
    settings = cast(MBStitchSettings, load_spec("table1").method_settings("mb-stitch"))
    episodes = baseline.assign(accomplished=gains)
    measured = MeasuredGain("mb-stitch", settings, pd.DataFrame(), episodes, baseline)
    result = measured.result("test")
    assert (result["gain_low"], result["gain"], result["gain_high"]) == (0, 0.5, 1)
    assert result["tasks"] == {"g0>g1": 1.0, "g1>g0>g2": 0.0}


def test_first_skills_count_where_candidates_have_their_own() -> None:
    """Failed by both: with shared first skills nothing could differ, with own ones it could."""
    baseline = pd.DataFrame(
        {"seed": 0, "task": "g0>g1", "episode": range(3), "length": 2, "accomplished": [0, 0, 1]}
    )
    settings = cast(MBStitchSettings, load_spec("table1").method_settings("mb-stitch"))
    episodes = baseline.assign(accomplished=[0, 1, 1])
    shared = MeasuredGain("mb-stitch", settings, pd.DataFrame(), episodes, baseline)
    places = {("g0>g1", episode): episode for episode in range(3)}
    assert shared.instances(places) == {1: 0.5, 2: 0.0}
    assert replace(shared, own_first_skill=True).instances(places) == {0: 0.0, 1: 0.5, 2: 0.0}

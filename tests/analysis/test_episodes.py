from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from analysis.episodes import COLUMNS, episodes_from_segments, write_episodes
from analysis.run import RunError, RunSpec


def play_slowly(segments: pd.DataFrame, spec: RunSpec) -> pd.DataFrame:
    """The same, as one would explain it: one episode after another, one skill after another."""
    by_key = {
        (s["method"], s["prefix"], s["seed"], s["episode"]): s for s in segments.to_dict("records")
    }
    rows = []
    for method in spec.methods:
        for task in sorted(spec.tasks, key=lambda task: task.count(">")):
            skills = task.split(">")
            limit = spec.step_limits[len(skills)]
            for seed in spec.seeds:
                for episode in range(spec.episodes):
                    accomplished, steps, known = 0, 0, True
                    for depth in range(1, len(skills) + 1):
                        filed = "" if depth == 1 else method
                        segment = by_key.get((filed, ">".join(skills[:depth]), seed, episode))
                        if segment is None:
                            known = steps >= limit
                            break
                        steps = min(segment["end_step"], limit)
                        if not segment["success"] or segment["end_step"] > limit:
                            break
                        accomplished += 1
                    if known:
                        score = accomplished / len(skills)
                        rows.append(
                            (seed, method, task, len(skills), episode, accomplished, score, steps)
                        )
    return pd.DataFrame(rows, columns=COLUMNS)


@settings(
    max_examples=25, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(data=st.data())
def test_agrees_with_the_slow_loop(data: Any, segments_of: Any, spec_dict: Any) -> None:
    """For any lengths, step limits, and whatever blocks are missing."""
    lengths = data.draw(st.sets(st.integers(1, 4), min_size=1, max_size=2))
    raw = spec_dict(seeds=2, episodes=2, lengths=tuple(sorted(lengths)))
    raw["step_limits"] = {str(n): data.draw(st.integers(5, 40)) for n in (1, 2, 3, 4)}
    spec, segments = RunSpec.from_dict(raw), segments_of(raw)
    lost = data.draw(st.sets(st.integers(0, len(segments) - 1), max_size=20))
    segments = segments.drop(index=list(lost)).sample(frac=1, random_state=0)
    pd.testing.assert_frame_equal(
        episodes_from_segments(segments, spec), play_slowly(segments, spec)
    )


def test_a_lost_first_skill_takes_every_method_with_it(segments: Any, spec: RunSpec) -> None:
    whole = episodes_from_segments(segments, spec)
    lost = segments.query("not (prefix == 'g0' and seed == 1 and episode == 3)")
    left_out = whole.query("task.str.startswith('g0') and seed == 1 and episode == 3")
    assert len(left_out) == 4 * (3 + 6 + 6)
    assert len(episodes_from_segments(lost, spec)) == len(whole) - len(left_out)


def test_segments_nobody_asked_for_are_ignored(segments: Any, spec: RunSpec) -> None:
    narrow = replace(spec, tasks=("g0>g1",), seeds=(1,), episodes=2)
    episodes = episodes_from_segments(segments, narrow)
    assert len(episodes) == 4 * 2
    assert set(episodes["seed"]) == {1}


def test_a_method_may_have_first_skills_of_its_own(segments: Any, spec: RunSpec) -> None:
    """Single-Policy's first skill is played by another policy than everybody else's."""
    failing = segments.query("depth == 1").assign(method="no-stitch", success=False)
    both = pd.concat([segments.query("depth == 1 or method != 'no-stitch'"), failing])
    with pytest.raises(RunError, match="own_first_skill"):
        episodes_from_segments(both, spec)
    episodes = episodes_from_segments(both, replace(spec, own_first_skill={"no-stitch"}))
    scores = episodes.groupby("method")["score"].mean()
    assert scores["no-stitch"] == 0
    assert scores["mb-stitch"] > 0.9


def test_until_they_are_played_such_a_method_has_no_episodes(segments: Any, spec: RunSpec) -> None:
    """It must not borrow the shared first skills."""
    episodes = episodes_from_segments(
        segments.query("method != 'no-stitch'"), replace(spec, own_first_skill={"no-stitch"})
    )
    assert "no-stitch" not in set(episodes["method"])


def test_a_segment_given_twice_is_refused(segments: Any, spec: RunSpec) -> None:
    with pytest.raises(RunError, match="twice"):
        episodes_from_segments(pd.concat([segments, segments[:1]]), spec)


def test_the_file_has_reproducible_bytes(tmp_path: Path, segments: Any, write_run: Any) -> None:
    shuffled = segments.sample(frac=1, random_state=1)
    paths = [
        write_run(tmp_path / name, segments=rows)
        for name, rows in (("a", segments), ("b", shuffled))
    ]
    for path in paths:
        write_episodes(path)
    first, second = ((path / "episodes.parquet").read_bytes() for path in paths)
    assert first == second
    columns = pd.read_parquet(paths[0] / "episodes.parquet").dtypes
    assert columns["accomplished"] == np.int64

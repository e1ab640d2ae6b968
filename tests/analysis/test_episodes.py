from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from analysis.episodes import COLUMNS, episodes_from_segments, write_episodes
from analysis.schema import RunError, RunSpec


def play_slowly(
    segments: pd.DataFrame, spec: RunSpec, quarantine: list[dict[str, Any]]
) -> pd.DataFrame:
    """The same, as one would explain it: one episode after another, one skill after another."""
    given_up = {
        (block["method"], block["prefix"], block["seed"], episode)
        for block in quarantine
        for episode in block["episodes"]
    }
    by_key = {
        (s["method"], s["prefix"], s["seed"], s["episode"]): s for s in segments.to_dict("records")
    }
    rows = []
    for method in spec.methods:
        for task in sorted(spec.tasks, key=lambda task: task.count(">")):
            skills = task.split(">")
            limit = spec.step_limits[len(skills)]
            for seed in spec.seeds:
                block, unknown = [], set()
                for episode in range(spec.episodes):
                    accomplished, steps = 0, 0
                    path = [
                        ("" if depth == 1 else method, ">".join(skills[:depth]), seed, episode)
                        for depth in range(1, len(skills) + 1)
                    ]
                    if given_up & set(path):
                        unknown.add(episode // spec.block_episodes)
                    for place in path:
                        segment = by_key.get(place)
                        if segment is None:
                            if steps < limit:
                                unknown.add(episode // spec.block_episodes)
                            break
                        steps = min(segment["end_step"], limit)
                        if not segment["success"] or segment["end_step"] > limit:
                            break
                        accomplished += 1
                    score = accomplished / len(skills)
                    block.append(
                        (seed, method, task, len(skills), episode, accomplished, score, steps)
                    )
                rows += [row for row in block if row[4] // spec.block_episodes not in unknown]
    return pd.DataFrame(rows, columns=COLUMNS)


@settings(
    max_examples=25, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(data=st.data())
def test_agrees_with_the_slow_loop(
    data: Any,
    segments_of: Callable[[dict[str, Any]], pd.DataFrame],
    spec_dict: Callable[..., dict[str, Any]],
) -> None:
    """For any lengths, step limits, and whatever blocks are missing."""
    lengths = data.draw(st.sets(st.integers(1, 4), min_size=1, max_size=2))
    raw = spec_dict(seeds=2, episodes=3, lengths=tuple(sorted(lengths)))
    raw["spec"] = {"block_episodes": data.draw(st.integers(1, 4))}
    raw["step_limits"] = {str(n): data.draw(st.integers(5, 40)) for n in (1, 2, 3, 4)}
    spec, segments = RunSpec.from_dict(raw), segments_of(raw)
    lost = data.draw(st.sets(st.integers(0, len(segments) - 1), max_size=20))
    segments = segments.drop(index=list(lost)).sample(frac=1, random_state=0)
    places = st.sampled_from(segments[["method", "prefix", "seed"]].to_dict("records"))
    quarantine = [
        {**place, "episodes": data.draw(st.sampled_from([[0], [1, 2]]))}
        for place in data.draw(st.lists(places, max_size=3))
    ]
    slowly = play_slowly(segments, spec, quarantine)
    pd.testing.assert_frame_equal(
        episodes_from_segments(segments, spec, quarantine),
        slowly,
        check_dtype=not slowly.empty,  # no rows have no types
    )


@pytest.fixture
def toy(spec_dict: Callable[..., dict[str, Any]]) -> tuple[RunSpec, pd.DataFrame]:
    """A succeeds in six of ten episodes, then B in all six: A>B is worth 0.6."""
    raw = {**spec_dict(seeds=1), "methods": [{"name": "mb"}, {"name": "other"}]}
    spec = RunSpec.from_dict({**raw, "tasks": ["A", "A>B", "A>B>C"], "skills": ["A", "B", "C"]})
    places = [("", "A", range(10))]
    places += [(m, prefix, range(6)) for m in spec.methods for prefix in ("A>B", "A>B>C")]
    segments = pd.DataFrame(
        {"seed": 0, "method": method, "prefix": prefix, "depth": prefix.count(">") + 1,
         "episode": episode, "success": prefix != "A" or episode < 6,
         "end_step": 10 * len(prefix.split(">"))}
        for method, prefix, episodes in places
        for episode in episodes
    )  # fmt: skip
    return spec, segments


def counts(episodes: pd.DataFrame) -> dict[tuple[str, str], int]:
    return dict(episodes.groupby(["method", "task"]).size())


def block_of(method: str, prefix: str, episodes: range) -> dict[str, Any]:
    return {"method": method, "seed": 0, "prefix": prefix, "episodes": list(episodes)}


def test_failures_before_a_block_that_was_given_up_do_not_count_alone(toy: Any) -> None:
    """Else the four failures would be all that is left of A>B: a cell of 0, where 0.6 is true."""
    spec, segments = toy
    whole = episodes_from_segments(segments, spec).query("task == 'A>B'")
    assert whole["score"].mean() == pytest.approx(0.6)
    left = segments.query("method != 'mb'")
    quarantine = [block_of("mb", "A>B", range(10))]
    episodes = episodes_from_segments(left, spec, quarantine)
    others = {("other", task): 10 for task in spec.tasks}
    assert counts(episodes) == {("mb", "A"): 10, **others}


def test_the_other_blocks_of_the_skill_stay(toy: Any) -> None:
    spec, segments = toy
    left = segments.query("not (method == 'mb' and episode < 5)")
    episodes = episodes_from_segments(left, spec, [block_of("mb", "A>B", range(5))])
    rest = episodes.query("method == 'mb' and task == 'A>B'")
    assert rest["episode"].tolist() == [5, 6, 7, 8, 9]
    assert rest["score"].tolist() == [1, 0, 0, 0, 0]


def test_a_first_skill_given_up_concerns_all_who_share_it(toy: Any) -> None:
    spec, segments = toy
    quarantine = [block_of("", "A", range(5))]
    assert set(counts(episodes_from_segments(segments, spec, quarantine)).values()) == {5}
    own = pd.concat([segments, segments.query("depth == 1").assign(method="other")])
    apart = replace(spec, own_first_skill=frozenset({"other"}))
    assert set(counts(episodes_from_segments(own, apart, quarantine)).values()) == {5, 10}


def test_while_a_block_is_still_to_be_played_its_failures_do_not_count_alone(toy: Any) -> None:
    """Nothing is in quarantine yet: that the block is missing shows in those who survived."""
    spec, segments = toy
    left = segments.query("not (method == 'mb' and episode < 5)")
    episodes = episodes_from_segments(left, replace(spec, block_episodes=5))
    rest = episodes.query("method == 'mb' and task == 'A>B'")
    assert rest["episode"].tolist() == [5, 6, 7, 8, 9]


def test_quarantine_of_what_nobody_asked_for_is_ignored(toy: Any) -> None:
    spec, segments = toy
    narrow = replace(spec, tasks=("A",), episodes=4)
    quarantine = [block_of("mb", "A>B", range(10)), {**block_of("", "A", range(5)), "seed": 3}]
    assert set(counts(episodes_from_segments(segments, narrow, quarantine)).values()) == {4}


def test_a_lost_first_skill_takes_every_method_with_it(
    segments: pd.DataFrame, spec: RunSpec
) -> None:
    whole = episodes_from_segments(segments, spec)
    lost = segments.query("not (prefix == 'g0' and seed == 1 and episode == 3)")
    left_out = whole.query("task.str.startswith('g0') and seed == 1 and episode == 3")
    assert len(left_out) == 4 * (3 + 6 + 6)
    assert len(episodes_from_segments(lost, spec)) == len(whole) - len(left_out)


def test_segments_nobody_asked_for_are_ignored(segments: pd.DataFrame, spec: RunSpec) -> None:
    narrow = replace(spec, tasks=("g0>g1",), seeds=(1,), episodes=2)
    episodes = episodes_from_segments(segments, narrow)
    assert len(episodes) == 4 * 2
    assert set(episodes["seed"]) == {1}


def test_a_method_may_have_first_skills_of_its_own(segments: pd.DataFrame, spec: RunSpec) -> None:
    """Single-Policy's first skill is played by another policy than everybody else's."""
    failing = segments.query("depth == 1").assign(method="no-stitch", success=False)
    both = pd.concat([segments.query("depth == 1 or method != 'no-stitch'"), failing])
    with pytest.raises(RunError, match="own_first_skill"):
        episodes_from_segments(both, spec)
    episodes = episodes_from_segments(both, replace(spec, own_first_skill=frozenset({"no-stitch"})))
    scores = episodes.groupby("method")["score"].mean()
    assert scores["no-stitch"] == 0
    assert scores["mb-stitch"] > 0.9


def test_until_they_are_played_such_a_method_has_no_episodes(
    segments: pd.DataFrame, spec: RunSpec
) -> None:
    """It must not borrow the shared first skills."""
    own = replace(spec, own_first_skill=frozenset({"no-stitch"}))
    episodes = episodes_from_segments(segments.query("method != 'no-stitch'"), own)
    assert "no-stitch" not in set(episodes["method"])


def test_a_segment_given_twice_is_refused(segments: pd.DataFrame, spec: RunSpec) -> None:
    with pytest.raises(RunError, match="twice"):
        episodes_from_segments(pd.concat([segments, segments[:1]]), spec)


def test_the_file_has_reproducible_bytes(
    tmp_path: Path, segments: pd.DataFrame, write_run: Callable[..., Path]
) -> None:
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

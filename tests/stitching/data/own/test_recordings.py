"""Where own data are, and Minari datasets of them: written by Minari itself, found by their id."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import minari
import numpy as np
import pytest
from gymnasium.spaces import Box, Dict
from minari.data_collector import EpisodeBuffer

from stitching.data.own.recordings import recordings
from stitching.data.transitions import DataError
from stitching.envs.maze import MAZE

ID = "maze/mine-v0"


@pytest.fixture(autouse=True)
def datasets(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path))
    return tmp_path


def episode(steps: int = 3, extra: int = 1, width: int = 6, **options: Any) -> EpisodeBuffer:
    """Its states count up."""
    flags = np.zeros(steps, dtype=bool)
    seen = np.arange(steps + extra, dtype=np.float32)[:, None] + np.zeros(width, dtype=np.float32)
    return EpisodeBuffer(
        observations=seen,
        actions=np.eye(4, dtype=np.float32)[np.arange(steps) % 4],
        rewards=np.zeros(steps),
        terminations=flags,
        truncations=np.r_[flags[1:], True],
        options=options or None,
    )


def write(*episodes: EpisodeBuffer, space: Any = None, name: str = ID) -> None:
    minari.create_dataset_from_buffers(
        name,
        list(episodes),
        observation_space=space or Box(-np.inf, np.inf, (6,)),
        action_space=Box(-1, 1, (4,)),
    )


def test_a_minari_dataset_and_its_labels() -> None:
    write(episode(3, skill="g1", accomplished=False), episode(2, skill="", accomplished=True))
    told = [(len(each), each.skill, each.success) for each in recordings(ID, MAZE)]
    assert told == [(3, "g1", False), (2, "", True)]


def test_observations_may_be_one_of_a_dict() -> None:
    buffer = episode()
    shown = replace(buffer, observations={"observation": buffer.observations})
    write(shown, space=Dict({"observation": Box(-np.inf, np.inf, (6,))}))
    (one,) = recordings(ID, MAZE)
    assert (len(one), one.skill) == (3, None)


def test_an_episode_without_its_last_observation_loses_its_last_action() -> None:
    write(episode(3), episode(4, extra=0))
    whole, cut = recordings(ID, MAZE)
    assert (len(whole), len(cut)) == (3, 3)
    assert cut.observations[:, 0].tolist() == [0, 1, 2, 3]
    assert cut.actions.argmax(axis=1).tolist() == [0, 1, 2]


@pytest.mark.parametrize(
    ("buffer", "told"),
    [
        (episode(width=7), r"episode 1: observations is float32 of shape \(4, 7\); .*\(4, 6\)"),
        (episode(extra=3), r"episode 1: observations is .*\(6, 6\); .*\(4, 6\)"),
        (episode(1, extra=0), "episode 1: no action whose result is known"),
    ],
    ids=["width", "more-observations", "one-action"],
)
def test_an_episode_that_does_not_fit_is_told_by_its_number(
    buffer: EpisodeBuffer, told: str
) -> None:
    write(episode(), buffer)
    with pytest.raises(DataError, match=told):
        recordings(ID, MAZE)


def test_numbers_that_are_not_finite_are_told(datasets: Path) -> None:
    wrong = episode()
    wrong.observations[2, 1] = np.nan
    write(episode(), wrong)
    with pytest.raises(DataError, match="mine-v0, episode 1: observations, row 2: not a finite"):
        recordings(ID, MAZE)


def test_a_source_that_is_not_there_is_named(datasets: Path) -> None:
    with pytest.raises(DataError, match=r"no file .*gone\.npz"):
        recordings(str(datasets / "gone.npz"), MAZE)
    with pytest.raises(DataError, match=r"no Minari dataset at .*gone-v0"):
        recordings("maze/gone-v0", MAZE)


def test_a_folder_that_is_no_minari_dataset_is_said(datasets: Path) -> None:
    data = datasets / "maze" / "empty-v0" / "data"
    data.mkdir(parents=True)
    with pytest.raises(DataError, match=r"at .*empty-v0: it has no data/metadata\.json"):
        recordings("maze/empty-v0", MAZE)
    (data / "metadata.json").write_text("{}")
    with pytest.raises(DataError, match="empty-v0: cannot be read as a Minari dataset"):
        recordings("maze/empty-v0", MAZE)

"""People's demonstrations of the kitchen: read, checked, and cut like scripted ones."""

from pathlib import Path
from types import SimpleNamespace

import minari
import numpy as np
import pytest
from gymnasium.spaces import Box, Dict
from minari.data_collector import EpisodeBuffer

from stitching.data.kitchen.human import (
    Recording,
    as_episode,
    human_demonstrations,
    minari_recordings,
    npz_recordings,
)
from stitching.data.kitchen.segments import as_transitions, cut
from stitching.data.transitions import DataError, Transitions, check
from stitching.envs.kitchen import KITCHEN, SKILLS

SHARED = Path(__file__).resolve().parents[5] / "shared"
REAL = SHARED / "data/kitchen_complete_v2_minari.npz"


def recording(steps: int = 3) -> tuple[np.ndarray, np.ndarray]:
    """One step before the last, the microwave is opened."""
    observations = np.zeros((steps + 1, 59), dtype=np.float32)
    observations[:, 32:39] = [-0.27, 0.35, 1.62, 1.0, 0.0, 0.0, 0.0]
    observations[steps - 1 :, 31] = -0.6
    return observations, np.full((steps, 9), 2.0)


def human_data(recordings: list[Recording]) -> Transitions:
    return as_transitions([s for one in recordings for s in cut(as_episode(*one))])


def test_human_data_clips_actions_and_drops_what_follows() -> None:
    data = human_data([recording(3), recording(5)])
    check(data, KITCHEN, "human")
    assert data.episode_ends.tolist() == [2, 6]
    assert (data.episode_skills == SKILLS.index("microwave")).all()
    assert (data.actions == 1).all()


def test_minari_episodes() -> None:
    observations, actions = recording()
    shown = SimpleNamespace(observations={"observation": observations}, actions=actions)
    assert len(human_data(minari_recordings([shown]))) == 2


def test_a_local_minari_dataset(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Written and found by Minari itself, by its id."""
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path))
    observations, actions = recording()
    flags = np.zeros(len(actions), dtype=bool)
    buffer = EpisodeBuffer(
        observations={"observation": observations},
        actions=actions,
        rewards=np.zeros(len(actions)),
        terminations=flags,
        truncations=np.r_[flags[1:], True],
    )
    minari.create_dataset_from_buffers(
        "kitchen/tiny-v0",
        [buffer],
        observation_space=Dict({"observation": Box(-np.inf, np.inf, (59,))}),
        action_space=Box(-1, 1, (9,)),
    )
    (shown,) = human_demonstrations("kitchen/tiny-v0")
    assert [(SKILLS[s.skill], s.success) for s in shown] == [("microwave", True)]


def test_a_source_that_is_not_there_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path))
    for gone in (str(tmp_path / "gone.npz"), "kitchen/gone-v0"):
        with pytest.raises(DataError, match=f"nothing at .*{gone}"):
            human_demonstrations(gone)


def test_a_folder_that_is_no_minari_dataset_is_said(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path))
    (tmp_path / "kitchen" / "empty-v0").mkdir(parents=True)
    with pytest.raises(DataError, match="empty-v0: cannot be read as a Minari dataset"):
        human_demonstrations("kitchen/empty-v0")


@pytest.mark.parametrize("last", [True, False], ids=["one-more", "as-many"])
def test_npz_with_or_without_the_last_observation(last: bool, tmp_path: Path) -> None:
    episodes = [recording(3), recording(5)]
    np.savez(
        tmp_path / "human.npz",
        observations=np.concatenate([o if last else o[:-1] for o, _ in episodes]),
        actions=np.concatenate([a for _, a in episodes]),
        episode_ends=np.array([3, 8]),
    )
    lengths = [len(actions) for _, actions in npz_recordings(tmp_path / "human.npz")]
    assert lengths == ([3, 5] if last else [2, 4])
    assert human_data(npz_recordings(tmp_path / "human.npz")).episode_ends.tolist() == [2, 6]


def test_recordings_that_do_not_fit_are_refused() -> None:
    observations, actions = recording()
    with pytest.raises(DataError, match="observations"):
        human_data([(observations[:-1], actions)])
    with pytest.raises(DataError, match="no demonstration"):
        human_data([(observations[:2], actions[:1])])


def sound() -> dict[str, np.ndarray]:
    """Two episodes of three actions each."""
    observations, actions = recording()
    return {
        "observations": np.concatenate([observations, observations]),
        "actions": np.concatenate([actions, actions]),
        "episode_ends": np.array([3, 6]),
    }


def with_value(column: str, row: int, value: float) -> dict[str, np.ndarray]:
    columns = sound()
    columns[column][row, 4] = value
    return columns


@pytest.mark.parametrize(
    ("columns", "told"),
    [
        ({"actions": np.zeros((3, 9))}, "has no observations and no episode_ends; .*found actions"),
        (sound() | {"episode_ends": np.array([2, 5])}, "episode_ends, row 1: 5, with 6 actions"),
        (sound() | {"episode_ends": np.array([3, 7])}, "episode_ends, row 1: 7, with 6 actions"),
        (sound() | {"episode_ends": np.array([3, 3])}, "episode_ends, row 1: 3 after 3"),
        (sound() | {"episode_ends": np.array([4, 3, 6])}, "episode_ends, row 1: 3 after 4"),
        (sound() | {"episode_ends": np.array([0, 6])}, "episode_ends, row 0: 0 after 0"),
        (sound() | {"episode_ends": np.array([], dtype=int)}, "episode_ends is empty"),
        (sound() | {"episode_ends": np.array([3.0, 6.0])}, "episode_ends is float64"),
        (sound() | {"episode_ends": np.array(6)}, r"episode_ends is int64 of shape \(\)"),
        (sound() | {"observations": np.zeros((8, 60))}, r"shape \(8, 60\); expected .*\(N, 59\)"),
        (sound() | {"actions": np.zeros((6, 9), dtype=int)}, "actions is int64"),
        (sound() | {"observations": np.zeros((5, 59))}, "5 observations for 6 actions"),
        (with_value("observations", 5, np.nan), "observations, row 5: not a finite number"),
        (with_value("actions", 2, np.inf), "actions, row 2: not a finite number"),
        (sound() | {"actions": np.array([{}] * 6)}, "cannot be read as an .npz file"),
    ],
)
def test_an_npz_that_is_wrong_is_told_where(
    columns: dict[str, np.ndarray], told: str, tmp_path: Path
) -> None:
    np.savez(tmp_path / "human.npz", **columns)
    with pytest.raises(DataError, match=rf"human\.npz: .*{told}"):
        npz_recordings(tmp_path / "human.npz")


@pytest.mark.parametrize("content", [b"", b"PK\x03\x04 cut off", b"\x93NUMPY", b"text"])
def test_a_file_that_is_no_archive_is_said(content: bytes, tmp_path: Path) -> None:
    (tmp_path / "human.npz").write_bytes(content)
    with pytest.raises(DataError, match=r"human\.npz: cannot be read as an .npz file"):
        npz_recordings(tmp_path / "human.npz")
    np.save(tmp_path / "one.npy", np.zeros(3))
    (tmp_path / "one.npy").rename(tmp_path / "one.npz")
    with pytest.raises(DataError, match=r"one\.npz: one array"):
        npz_recordings(tmp_path / "one.npz")


def test_an_episode_is_told_by_its_number(tmp_path: Path) -> None:
    columns = sound()
    columns["observations"][4:] = 0  # nothing is accomplished in the second one
    np.savez(tmp_path / "human.npz", **columns)
    shown = human_demonstrations(str(tmp_path / "human.npz"))
    assert [len(segments) for segments in shown] == [1, 0]


@pytest.mark.skipif(not REAL.exists(), reason="the real demonstrations are not here")
def test_real_demonstrations_show_four_skills_each() -> None:
    data = human_data(npz_recordings(REAL))
    check(data, KITCHEN, str(REAL))
    shown = [SKILLS[skill] for skill in data.episode_skills]
    assert shown == ["microwave", "kettle", "light switch", "slide cabinet"] * 14
    assert data.episode_successes.all()
    lengths = np.diff(data.episode_ends, prepend=0)
    assert lengths.min() > 20
    assert lengths.max() < 120

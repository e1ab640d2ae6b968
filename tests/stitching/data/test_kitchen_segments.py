"""Cutting episodes into skills, scripted and human ones alike."""

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
from stitching.data.kitchen.segments import Episode, as_transitions, cut
from stitching.data.transitions import DataError, Transitions, check
from stitching.envs.kitchen import KITCHEN, SKILLS

SHARED = Path(__file__).resolve().parents[4] / "shared"
REAL = SHARED / "data/kitchen_complete_v2_minari.npz"


def episode(steps: int, **achieved: tuple[int, ...]) -> Episode:
    """An episode in which a skill, named by its first word, holds in the given states."""
    holds = np.zeros((steps + 1, len(SKILLS)), dtype=bool)
    for word, states in achieved.items():
        skill = next(i for i, name in enumerate(SKILLS) if name.startswith(word))
        holds[list(states), skill] = True
    return Episode(
        np.zeros((steps + 1, 59)),
        np.zeros((steps, 9)),
        holds,
        np.zeros((steps + 1, 0)),
        np.zeros(steps, dtype=bool),
    )


def cuts(shown: Episode, order: tuple[str, ...] = ()) -> list[tuple[str, int, int, bool]]:
    return [(SKILLS[s.skill], s.start, s.end, s.success) for s in cut(shown, order)]


def test_skills_end_where_first_achieved_though_later_undone() -> None:
    shown = episode(9, kettle=(7, 8), microwave=(3, 4, 8))
    assert cuts(shown) == [("microwave", 0, 3, True), ("kettle", 3, 7, True)]


def test_what_held_from_the_start_is_no_skill() -> None:
    assert cuts(episode(5, kettle=(0, 1), slide=(4,))) == [("slide cabinet", 0, 4, True)]


def test_of_two_achieved_at_once_one_is_a_segment() -> None:
    assert cuts(episode(5, bottom=(4,), top=(4,))) == [("bottom burner", 0, 4, True)]


def test_the_rest_is_a_miss_of_the_orders_next_skill() -> None:
    shown = episode(9, kettle=(4,))
    missed = [("kettle", 0, 4, True), ("light switch", 4, 9, False)]
    assert cuts(shown, ("kettle", "light switch", "slide cabinet")) == missed
    assert cuts(shown, ("kettle",)) == missed[:1]


def test_an_accident_ends_a_demonstration_that_was_asked_for() -> None:
    """The motions were another skill's; people's demonstrations have no order to be out of."""
    shown = episode(9, kettle=(2,), bottom=(4,), top=(7,))
    order = ("kettle", "top burner", "bottom burner")
    assert cuts(shown, order) == [("kettle", 0, 2, True)]
    assert cuts(shown, order[1:]) == []
    assert len(cuts(shown)) == 3


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


def test_an_unknown_source_of_recordings_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path))
    with pytest.raises(DataError, match=r"no file .*gone\.npz"):
        human_demonstrations(str(tmp_path / "gone.npz"))
    with pytest.raises(DataError, match="no Minari dataset 'kitchen/gone-v0'"):
        human_demonstrations("kitchen/gone-v0")


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


def test_recordings_that_do_not_fit_are_refused(tmp_path: Path) -> None:
    observations, actions = recording()
    with pytest.raises(DataError, match="observations"):
        human_data([(observations[:-1], actions)])
    with pytest.raises(DataError, match="no demonstration"):
        human_data([(observations[:2], actions[:1])])
    path = tmp_path / "human.npz"
    np.savez(path, observations=observations[:2], actions=actions, episode_ends=np.array([3]))
    with pytest.raises(DataError, match=r"human\.npz: 2 observations for 3 actions"):
        npz_recordings(path)


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

"""People's demonstrations of the kitchen, cut like scripted ones."""

from pathlib import Path

import numpy as np
import pytest

from stitching.data.kitchen.human import human_demonstrations
from stitching.data.kitchen.segments import as_transitions
from stitching.data.own.npz import npz_recordings
from stitching.data.own.recording import Recording
from stitching.data.transitions import DataError, Transitions, check
from stitching.envs.kitchen import KITCHEN, SKILLS

SHARED = Path(__file__).resolve().parents[5] / "shared"
REAL = SHARED / "data/kitchen_complete_v2_minari.npz"


def recording(steps: int = 3) -> Recording:
    """One step before the last, the microwave is opened."""
    observations = np.zeros((steps + 1, 59), dtype=np.float32)
    observations[:, 32:39] = [-0.27, 0.35, 1.62, 1.0, 0.0, 0.0, 0.0]
    observations[steps - 1 :, 31] = -0.6
    return Recording(observations, np.full((steps, 9), 2.0))


def human_data(recordings: list[Recording]) -> Transitions:
    return as_transitions([s for one in human_demonstrations(recordings) for s in one])


def test_human_data_clips_actions_and_drops_what_follows() -> None:
    data = human_data([recording(3), recording(5)])
    check(data, KITCHEN, "human")
    assert data.episode_ends.tolist() == [2, 6]
    assert (data.episode_skills == SKILLS.index("microwave")).all()
    assert (data.actions == 1).all()


def test_what_accomplishes_nothing_has_no_segment() -> None:
    shown = recording()
    nothing = Recording(shown.observations[:2], shown.actions[:1])
    assert [len(one) for one in human_demonstrations([shown, nothing])] == [1, 0]
    with pytest.raises(DataError, match="no demonstration"):
        human_data([nothing])


@pytest.mark.skipif(not REAL.exists(), reason="the real demonstrations are not here")
def test_real_demonstrations_show_four_skills_each() -> None:
    data = human_data(npz_recordings(REAL, KITCHEN))
    check(data, KITCHEN, str(REAL))
    shown = [SKILLS[skill] for skill in data.episode_skills]
    assert shown == ["microwave", "kettle", "light switch", "slide cabinet"] * 14
    assert data.episode_successes.all()
    lengths = np.diff(data.episode_ends, prepend=0)
    assert lengths.min() > 20
    assert lengths.max() < 120

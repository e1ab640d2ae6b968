"""Rates that data are chosen by: from each skill's own starts, and where the one before ended."""

from typing import Any, cast

import numpy as np
import pytest
import torch

from stitching.data.robosuite.rates import RatesConfig, policy_rates
from stitching.envs.robosuite.door import DOOR, HINGE, SKILLS, Door
from stitching.models.agent import Agent


class Still:
    """A policy that goes to the middle of the workspace, and values that say nothing."""

    def act(self, states: torch.Tensor, *asked: Any) -> np.ndarray:
        return np.zeros((len(states), DOOR.actions.size), dtype=np.float32)

    def values(self, states: torch.Tensor, condition: int) -> torch.Tensor:
        return torch.zeros(1, len(states))


def opened_at_once(door: Door, observations: np.ndarray, skill: int) -> Any:
    """Opening always holds, so a task's closing begins, and ends, at a door that is closed."""
    return observations[:, HINGE] < (0.1 if SKILLS[skill] == "close door" else np.inf)


def test_own_starts_and_the_hand_over_are_told_apart(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Door, "achieved", opened_at_once)
    config = RatesConfig(trials=2, step_limit=1)
    rates = policy_rates(cast(Agent, Still()), DOOR, SKILLS, config, seed=0)
    assert rates.own == {"open door": (2, 2), "close door": (0, 2)}
    assert rates.after == (2, 2)
    assert rates.score == 1

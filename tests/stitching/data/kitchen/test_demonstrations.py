"""Scripted kitchen demonstrations: true, cut where achieved, a function of seed, order, episode."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from stitching.data.kitchen.demonstrations import (
    KitchenDataConfig,
    held_out,
    human_orders,
    kept,
    orders,
    play,
)
from stitching.data.kitchen.rates import RatesConfig, success_rates, summary
from stitching.data.kitchen.segments import as_transitions
from stitching.data.transitions import DataError, Transitions, check, concatenate
from stitching.envs.kitchen import GOAL_RADIUS, KITCHEN, SKILLS, START, goal_distances

CONFIG = KitchenDataConfig(episodes=1)
ORDERS = (
    ("microwave", "kettle", "hinge cabinet", "slide cabinet"),
    ("top burner", "bottom burner", "light switch", "slide cabinet"),
)
BLUR = 0.005  # more than the observation's noise moves a distance
SHORT_ORDERS = (("kettle",), ("microwave",))


def collect(config: KitchenDataConfig, orders: Sequence[tuple[str, ...]], seed: int) -> Transitions:
    return as_transitions([s for order in orders for s in kept(config, play(config, order, seed))])


@pytest.fixture(scope="module")
def data() -> Transitions:
    return collect(CONFIG, ORDERS, seed=0)


def same_bytes(first: Transitions, second: Transitions) -> bool:
    pairs = zip(first.columns().values(), second.columns().values(), strict=True)
    return all(a.tobytes() == b.tobytes() for a, b in pairs)


def goal_distance(observations: np.ndarray, skill: int) -> np.ndarray:
    return goal_distances(np.hstack([observations[:, :9], observations[:, 18:39]]), skill)


def test_the_24_human_orders() -> None:
    orders = human_orders()
    assert len(set(orders)) == 24
    assert all(len(set(order)) == 4 for order in orders)
    assert {name for order in orders for name in order} == set(SKILLS)
    assert all("microwave" not in order[1:] for order in orders)


def test_demonstrations_hold_what_their_orders_ask_for(data: Transitions) -> None:
    check(data, KITCHEN, "data")
    shown = [SKILLS[skill] for skill in data.episode_skills]
    assert shown == [name for order in ORDERS for name in order]
    assert data.episode_successes.all()


def test_a_segment_ends_where_its_skill_is_first_achieved(data: Transitions) -> None:
    for start, end, skill in zip(
        data.episode_starts, data.episode_ends, data.episode_skills, strict=True
    ):
        distances = goal_distance(data.next_observations[start:end], skill)
        assert (distances[:-1] > GOAL_RADIUS - BLUR).all()
        assert distances[-1] < GOAL_RADIUS + BLUR


def test_demonstrations_are_unbroken_through_their_skills(data: Transitions) -> None:
    first_of_an_order = [0, data.episode_ends[len(ORDERS[0]) - 1]]
    inside = np.setdiff1d(np.arange(len(data)), first_of_an_order)
    assert np.array_equal(data.observations[inside], data.next_observations[inside - 1])


def test_actions_lead_to_what_was_recorded(data: Transitions) -> None:
    """Joint positions asked for by an action are approached, not passed."""
    asked = 0.16 * data.actions[:, :7]
    moved = data.next_observations[:, :7] - data.observations[:, :7]
    assert np.corrcoef(asked.ravel(), moved.ravel())[0, 1] > 0.8


@pytest.fixture(scope="module")
def short() -> Transitions:
    return collect(replace(CONFIG, episodes=2), SHORT_ORDERS, seed=0)


def test_orders_can_be_collected_apart(short: Transitions) -> None:
    config = replace(CONFIG, episodes=2)
    parts = [collect(config, [order], seed=0) for order in SHORT_ORDERS]
    assert same_bytes(concatenate(parts), short)


def test_fewer_episodes_are_the_first_of_more(short: Transitions) -> None:
    fewer = collect(CONFIG, SHORT_ORDERS[:1], seed=0)
    assert fewer.actions.tobytes() == short.actions[: len(fewer)].tobytes()


def test_another_seed_gives_other_demonstrations(short: Transitions) -> None:
    assert not same_bytes(collect(replace(CONFIG, episodes=2), SHORT_ORDERS, seed=1), short)


def test_every_source_has_its_orders() -> None:
    assert orders(CONFIG) == human_orders()
    assert orders(replace(CONFIG, source="single-skill")) == tuple((name,) for name in SKILLS)


def test_held_out_skills_begin_where_their_snapshots_are(monkeypatch: pytest.MonkeyPatch) -> None:
    config = replace(CONFIG, episodes=2, held_out=1, source="single-skill")
    alone = ("kettle",), ("microwave",)
    monkeypatch.setattr("stitching.data.kitchen.demonstrations.orders", lambda config: alone)
    data, starts = held_out(config, seed=0)
    assert [SKILLS[skill] for skill in data.episode_skills] == ["kettle", "microwave"]
    env = KITCHEN.vector_env()
    env.restore(starts, [np.random.default_rng(0), np.random.default_rng(1)])
    first = data.observations[data.episode_starts]
    assert np.array_equal(env.observe(np.arange(2)), first)
    seen = collect(config, [("kettle",)], seed=0)
    assert not (seen.observations == first[0]).all(axis=1).any()


def test_single_skills_start_from_the_start_pose() -> None:
    single = collect(CONFIG, [("kettle",), ("microwave",)], seed=0)
    starts = single.observations[single.episode_starts]
    assert np.abs(starts[0] - starts[1]).max() < 0.02  # noise alone
    assert [SKILLS[skill] for skill in single.episode_skills] == ["kettle", "microwave"]


def test_a_missed_skill_ends_its_demonstration_and_is_kept_on_demand() -> None:
    config = replace(CONFIG, skill_steps=5)
    with pytest.raises(DataError, match="no demonstration"):
        collect(config, ORDERS, seed=0)
    missed = collect(replace(config, keep_failures=True), ORDERS, seed=0)
    assert missed.episode_ends.tolist() == [5, 10]
    assert [SKILLS[skill] for skill in missed.episode_skills] == [order[0] for order in ORDERS]
    assert not missed.episode_successes.any()


@pytest.mark.parametrize("return_home", [True, False])
def test_the_hand_goes_home_between_skills_if_it_shall(return_home: bool) -> None:
    order = ("bottom burner", "light switch")
    data = collect(replace(CONFIG, return_home=return_home), [order], seed=0)
    (second,) = data.episode_rows(SKILLS.index("light switch"))
    nearest = np.abs(data.observations[second, :7] - START[:7]).max(axis=1).min()
    assert (nearest < 0.35) == return_home


def starts(data: Transitions) -> np.ndarray:
    """The arm's joints where each skill begins: (E, 7) rad."""
    return data.observations[data.episode_starts, :7]


def test_skills_can_begin_elsewhere_than_where_one_ended() -> None:
    order = ("bottom burner", "light switch")
    usual, elsewhere = (
        collect(replace(CONFIG, episodes=2, elsewhere=share), [order], seed=0) for share in (0, 1)
    )
    check(elsewhere, KITCHEN, "data")
    for data in (usual, elsewhere):
        assert [SKILLS[skill] for skill in data.episode_skills] == 2 * list(order)
    apart = {
        name: np.abs(starts(data)[1::2] - data.next_observations[data.episode_ends - 1][::2, :7])
        for name, data in (("usual", usual), ("elsewhere", elsewhere))
    }
    assert apart["usual"].max() < 0.02 < 0.2 < apart["elsewhere"].max(axis=1).min()
    assert np.abs(starts(elsewhere)[1] - starts(elsewhere)[3]).max() > 0.2  # each at its own
    first = slice(0, elsewhere.episode_ends[0])
    assert elsewhere.actions[first].tobytes() == usual.actions[first].tobytes()


def test_a_demonstration_sets_out_as_people_do() -> None:
    """How far a joint has moved after 5, 8, 12, 16 steps, mean over Minari's 14 recordings."""
    people = np.array([0.12, 0.21, 0.41, 0.63])  # rad
    steps = [5, 8, 12, 16]
    config = replace(CONFIG, episodes=4)
    eased = setting_out(replace(config, ease=18))[steps]
    assert np.abs(eased - people).max() < 0.1
    hasty = setting_out(config)[steps]
    assert (hasty > people + 0.2).all()


def setting_out(config: KitchenDataConfig) -> np.ndarray:
    """How far the joint that moved most has moved by each step, mean over demonstrations."""
    shown = [one[0] for one in play(config, SHORT_ORDERS[1], seed=0)]
    joints = [segment.episode.observations[:30, :7] for segment in shown]
    return np.mean([np.abs(path - path[0]).max(axis=1) for path in joints], axis=0)


def test_a_skill_can_have_a_hand_of_its_own() -> None:
    config = replace(CONFIG, quality=1.0, qualities={"kettle": 0.0})
    assert config.style("kettle") == replace(CONFIG, quality=0.0).style("microwave")
    assert config.style("microwave") == replace(CONFIG, quality=1.0).style("kettle")
    own = collect(config, SHORT_ORDERS[1:], seed=0)
    assert same_bytes(own, collect(replace(CONFIG, quality=1.0), SHORT_ORDERS[1:], seed=0))


def test_orders_have_more_or_fewer_demonstrations_by_their_first_skill() -> None:
    config = replace(CONFIG, episodes=2, first_weights={"kettle": 0, "microwave": 1.5})
    assert [
        config.demonstrations((first,)) for first in ("kettle", "microwave", "bottom burner")
    ] == [0, 3, 2]
    assert {order[0] for order in orders(config)} == {"microwave", "bottom burner"}
    assert len(play(replace(config, skill_steps=1), ("microwave",), seed=0)) == 3


@pytest.mark.parametrize(
    ("setting", "message"),
    [
        ({"qualities": {"toaster": 0.5}}, "qualities: no skill 'toaster'"),
        ({"first_weights": {"toaster": 0.5}}, "first_weights: no skill 'toaster'"),
        ({"qualities": {"kettle": 1.5}}, "qualities, kettle: must be at most 1"),
        ({"elsewhere": -0.1}, "elsewhere: must be at least 0"),
        ({"first_weights": {"kettle": -1.0}}, "first_weights, kettle: must be at least 0"),
        ({"ease": -1}, "ease: must be at least 0"),
    ],
)
def test_settings_out_of_range_are_refused(setting: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        replace(CONFIG, **setting)


def test_a_poor_hand_is_worse_than_an_expert() -> None:
    config = replace(CONFIG, episodes=3, skill_steps=100, keep_failures=True)
    expert, poor = (
        collect(replace(config, quality=quality), [("slide cabinet",)], seed=0)
        for quality in (1.0, 0.0)
    )
    assert expert.episode_successes.all()
    assert len(expert) < len(poor)


def test_every_demonstrator_works_from_the_start_pose() -> None:
    attempts = success_rates(RatesConfig(attempts=2, episodes=0))
    assert set(attempts) == {("start", name) for name in SKILLS}
    done = [steps > 0 for each in attempts.values() for steps in each]
    assert len(done) == 2 * len(SKILLS)
    assert np.mean(done) >= 0.9
    assert "microwave      from start             2 of    2" in summary(attempts)

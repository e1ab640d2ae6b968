"""Cutting episodes into skills."""

import numpy as np

from stitching.data.kitchen.segments import Episode, cut
from stitching.envs.kitchen import SKILLS


def episode(steps: int, relocating: slice = slice(0), **achieved: tuple[int, ...]) -> Episode:
    """An episode in which a skill, named by its first word, holds in the given states."""
    moved = np.zeros(steps, dtype=bool)
    moved[relocating] = True
    holds = np.zeros((steps + 1, len(SKILLS)), dtype=bool)
    for word, states in achieved.items():
        skill = next(i for i, name in enumerate(SKILLS) if name.startswith(word))
        holds[list(states), skill] = True
    return Episode(
        np.zeros((steps + 1, 59)),
        np.zeros((steps, 9)),
        holds,
        np.zeros((steps + 1, 0)),
        moved,
    )


def cuts(shown: Episode, order: tuple[str, ...] = ()) -> list[tuple[str, int, int, bool]]:
    return [(SKILLS[s.skill], s.start, s.end, s.success) for s in cut(shown, order)]


def test_skills_end_where_first_achieved_though_later_undone() -> None:
    shown = episode(9, kettle=(7, 8), microwave=(3, 4, 8))
    assert cuts(shown) == [("microwave", 0, 3, True), ("kettle", 3, 7, True)]


def test_a_skill_begins_where_the_arm_was_taken() -> None:
    order = ("kettle", "light switch", "slide cabinet")
    shown = episode(9, relocating=slice(2, 5), kettle=(2,), light=(7,))
    done = [("kettle", 0, 2, True), ("light switch", 5, 7, True)]
    assert cuts(shown, order) == [*done, ("slide cabinet", 7, 9, False)]
    assert cuts(episode(9, relocating=slice(7, 8), kettle=(2,), light=(7,)), order) == [
        ("kettle", 0, 2, True),
        ("light switch", 2, 7, True),
        ("slide cabinet", 8, 9, False),
    ]


def test_a_skill_that_came_about_on_the_way_elsewhere_has_no_segment() -> None:
    shown = episode(9, relocating=slice(2, 5), kettle=(2,), light=(5,), slide=(8,))
    order = ("kettle", "light switch", "slide cabinet")
    assert cuts(shown, order) == [("kettle", 0, 2, True), ("slide cabinet", 5, 8, True)]


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

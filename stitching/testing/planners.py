"""What every planner must do."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
import torch

from stitching.envs.protocol import ActionSpace
from stitching.planning.protocol import Planner, Score

PROBLEMS = 5


def streams(problems: int = PROBLEMS) -> list[np.random.Generator]:
    """One stream a problem, the same with every call."""
    return [np.random.Generator(np.random.Philox(key=problem)) for problem in range(problems)]


def exact_bowls(problems: torch.Tensor, actions: torch.Tensor) -> torch.Tensor:
    """Bowls at different places, in small integers: exact in float32 in any order of summation."""
    target = 10 * (problems[:, None, None, None] - 2)
    return -((actions * 64).round() - target).square().sum(dim=(2, 3)) / 4096


def only(score: Score, chosen: torch.Tensor) -> Score:
    """The same score for a planner that sees the chosen problems alone."""
    return lambda problems, actions: score(chosen[problems], actions)


class PlannerConformance:
    """To be inherited from, with fixtures `planner` and `space`: actions that it can search."""

    def test_shapes_and_types(self, planner: Planner, space: ActionSpace) -> None:
        plan = planner.plan(exact_bowls, streams(), space)
        assert plan.actions.shape == (PROBLEMS, planner.horizon, space.size)
        assert plan.actions.dtype == plan.objective.dtype == torch.float32
        assert plan.objective.shape == plan.iterations.shape == (PROBLEMS,)
        assert plan.iterations.dtype == torch.int64
        assert (plan.iterations >= 1).all()

    def test_what_the_score_is_given(self, planner: Planner, space: ActionSpace) -> None:
        def score(problems: torch.Tensor, actions: torch.Tensor) -> torch.Tensor:
            assert problems.dtype == torch.int64
            assert actions.dtype == torch.float32
            assert actions.shape[0] == len(problems)
            assert actions.shape[2:] == (planner.horizon, space.size)
            assert actions.abs().max() <= 1
            return exact_bowls(problems, actions)

        planner.plan(score, streams(), space)

    def test_actions_stay_within_bounds(self, planner: Planner, space: ActionSpace) -> None:
        plan = planner.plan(lambda _, actions: actions.sum(dim=(2, 3)), streams(), space)
        assert plan.actions.abs().max() <= 1

    def test_objective_is_the_score_of_the_plan(self, planner: Planner, space: ActionSpace) -> None:
        plan = planner.plan(exact_bowls, streams(), space)
        rescored = exact_bowls(torch.arange(PROBLEMS), plan.actions[:, None])[:, 0]
        assert torch.equal(plan.objective, rescored)

    def test_same_streams_same_plan_whatever_the_global_state(
        self, planner: Planner, space: ActionSpace
    ) -> None:
        torch.manual_seed(0)
        first = planner.plan(exact_bowls, streams(), space)
        torch.manual_seed(1)
        state = torch.get_rng_state()
        second = planner.plan(exact_bowls, streams(), space)
        assert torch.equal(torch.get_rng_state(), state)
        assert torch.equal(first.actions, second.actions)
        assert torch.equal(first.objective, second.objective)

    def test_other_streams_another_plan(self, planner: Planner, space: ActionSpace) -> None:
        plan = planner.plan(lambda _, actions: torch.zeros(actions.shape[:2]), streams(), space)
        assert len(plan.actions.unique(dim=0)) > 1

    @pytest.mark.parametrize("chosen", [[0], [3], [4, 1], [0, 2, 4]])
    def test_a_problem_is_independent_of_its_batch_mates(
        self, planner: Planner, space: ActionSpace, chosen: list[int]
    ) -> None:
        together = planner.plan(exact_bowls, streams(), space)
        subset = torch.tensor(chosen)
        alone = planner.plan(only(exact_bowls, subset), [streams()[i] for i in chosen], space)
        assert torch.equal(alone.iterations, together.iterations[subset])
        torch.testing.assert_close(alone.actions, together.actions[subset], rtol=0, atol=1e-6)

    def test_a_problem_takes_from_its_own_stream_only_what_it_needs(
        self, planner: Planner, space: ActionSpace
    ) -> None:
        in_company, by_itself = streams(), streams()
        planner.plan(exact_bowls, in_company, space)
        for i in range(PROBLEMS):
            planner.plan(only(exact_bowls, torch.tensor([i])), [by_itself[i]], space)
        assert [s.random() for s in in_company] == [s.random() for s in by_itself]

    def test_a_plan_that_it_is_given_is_made_use_of(
        self, planner: Planner, space: ActionSpace
    ) -> None:
        """Begun at the best plan that there is, a search ends no worse than by itself."""
        actions = space.uniform(streams(1)[0], (PROBLEMS, planner.horizon))
        fair = torch.from_numpy(np.asarray(actions, dtype=np.float32))

        def score(problems: torch.Tensor, actions: torch.Tensor) -> torch.Tensor:
            return -(actions - fair[problems, None]).abs().amax(dim=(2, 3))

        begun = planner.plan(score, streams(), space, fair)
        by_itself = planner.plan(score, streams(), space)
        assert (begun.objective >= by_itself.objective - 1e-3).all()

    def test_nothing_to_plan(self, planner: Planner, space: ActionSpace) -> None:
        plan = planner.plan(exact_bowls, [], space)
        assert plan.actions.shape == (0, planner.horizon, space.size)
        assert len(plan.objective) == len(plan.iterations) == 0

    @pytest.mark.parametrize("mode", [torch.inference_mode, torch.no_grad, torch.enable_grad])
    def test_leaves_no_graph_behind(
        self, planner: Planner, space: ActionSpace, mode: Callable
    ) -> None:
        weight = torch.ones((), requires_grad=True)
        with mode():
            plan = planner.plan(
                lambda p, actions: weight * exact_bowls(p, actions), streams(), space
            )
        assert not plan.actions.requires_grad
        assert not plan.objective.requires_grad

    def test_scores_that_are_nan_lose(self, planner: Planner, space: ActionSpace) -> None:
        def score(problems: torch.Tensor, actions: torch.Tensor) -> torch.Tensor:
            values = actions[..., 0].sum(dim=2)
            return torch.where(values > 1.5, torch.nan, values)

        plan = planner.plan(score, streams(), space)
        assert plan.objective.isfinite().all()
        assert (plan.objective <= 1.5).all()

    def test_a_problem_that_is_all_nan_is_named(self, planner: Planner, space: ActionSpace) -> None:
        def score(problems: torch.Tensor, actions: torch.Tensor) -> torch.Tensor:
            return exact_bowls(problems, actions).where(problems[:, None] != 3, torch.nan)

        with pytest.raises(FloatingPointError, match=r"\[3\]"):
            planner.plan(score, streams(), space)

"""What every stitcher must do."""

from __future__ import annotations

import numpy as np
import torch

from stitching.envs.protocol import ActionSpace
from stitching.methods.protocol import Proposal, Stitcher
from stitching.streams import stream


def streams(n: int) -> list[np.random.Generator]:
    """One stream an episode, the same with every call."""
    return [stream("conformance", i) for i in range(n)]


def proposed(stitcher: Stitcher, states: torch.Tensor) -> Proposal:
    """From a skill's end to the next one."""
    return stitcher.propose(states, 0, 1, streams(len(states)))


class StitcherConformance:
    """To be inherited from, with fixtures `stitcher`, `states` and `space`.

    states (n, observation) are some that the stitcher may be asked about, at least two; space is
    the actions of their benchmark. A stitcher that never takes a step has nothing to conform to.
    """

    def test_proposals_are_actions(
        self, stitcher: Stitcher, states: torch.Tensor, space: ActionSpace
    ) -> None:
        for n in (1, len(states)):
            proposal = proposed(stitcher, states[:n])
            assert proposal.actions.dtype == np.float32
            assert proposal.actions.ndim == 3
            assert len(proposal.actions) == n
            assert proposal.actions.shape[1] >= 1
            assert proposal.actions.shape[2] == space.size
            assert proposal.wanted.dtype == bool
            assert proposal.wanted.shape == (n,)
            wanted = proposal.actions[proposal.wanted]
            assert np.abs(wanted).max(initial=0) <= 1
            if space.discrete:
                assert set(np.unique(wanted)) <= {0, 1}
                assert (wanted.sum(axis=2) == 1).all()

    def test_it_says_how_its_stitches_end(self, stitcher: Stitcher) -> None:
        assert stitcher.limit >= 1
        assert isinstance(stitcher.before_first, bool)
        assert isinstance(stitcher.until_value_falls, bool)

    def test_it_leads_to_a_first_skill_where_it_says_so(
        self, stitcher: Stitcher, states: torch.Tensor
    ) -> None:
        if stitcher.before_first:
            proposal = stitcher.propose(states, None, 1, streams(len(states)))
            assert len(proposal.actions) == len(states)

    def test_a_proposal_belongs_to_its_stream_and_state(
        self, stitcher: Stitcher, states: torch.Tensor
    ) -> None:
        together = proposed(stitcher, states)
        torch.manual_seed(0)
        again = proposed(stitcher, states)
        assert np.array_equal(again.actions, together.actions)
        assert np.array_equal(again.wanted, together.wanted)
        own = streams(len(states))
        for row in range(len(states)):
            alone = stitcher.propose(states[row : row + 1], 0, 1, [own[row]])
            np.testing.assert_allclose(alone.actions[0], together.actions[row], atol=1e-6)
            assert alone.wanted[0] == together.wanted[row]

    def test_the_global_state_of_chance_is_left_alone(
        self, stitcher: Stitcher, states: torch.Tensor
    ) -> None:
        before, numpys = torch.get_rng_state(), np.random.get_state()  # noqa: NPY002
        proposed(stitcher, states)
        assert torch.equal(torch.get_rng_state(), before)
        assert str(np.random.get_state()) == str(numpys)  # noqa: NPY002

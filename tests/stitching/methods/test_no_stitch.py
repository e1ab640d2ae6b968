"""No-Stitch does nothing."""

import pytest
import torch

from stitching.methods.no_stitch import NoStitch
from tests.stitching.methods.linear import streams


def test_no_stitch_takes_no_step() -> None:
    assert NoStitch().limit == 0
    with pytest.raises(AssertionError, match="no stitching"):
        NoStitch().propose(torch.zeros(1, 6), 0, 1, streams(1))

"""The methods by name: those of this package, and those of installed packages."""

from __future__ import annotations

from stitching.methods.mb_stitch import MB_STITCH
from stitching.methods.mf_stitch import MF_STITCH
from stitching.methods.no_stitch import NO_STITCH
from stitching.methods.protocol import Method
from stitching.methods.random_stitch import RANDOM_STITCH
from stitching.methods.reach_stitch import REACH_STITCH
from stitching.methods.single_policy import SINGLE_POLICY
from stitching.registry import with_installed

METHODS: dict[str, Method] = with_installed(
    "skillstitch.methods",
    {
        "no-stitch": NO_STITCH,
        "random-stitch": RANDOM_STITCH,
        "mf-stitch": MF_STITCH,
        "mb-stitch": MB_STITCH,
        "reach-stitch": REACH_STITCH,
        "single-policy": SINGLE_POLICY,
    },
    lambda part: isinstance(part, Method),
)

"""The methods by name: those of this package, and those of installed packages."""

from __future__ import annotations

from typing import Any

from stitching.methods.mb_stitch import MB_STITCH
from stitching.methods.mf_stitch import MF_STITCH
from stitching.methods.no_stitch import NO_STITCH
from stitching.methods.protocol import Method, MethodSettings
from stitching.methods.random_stitch import RANDOM_STITCH
from stitching.methods.reach_stitch import REACH_STITCH
from stitching.methods.single_policy import SINGLE_POLICY
from stitching.registry import PartError, lacking, with_installed, wrong_settings


def _wrong(part: Any) -> str:
    """What keeps a part from being a method, in words; empty where nothing does."""
    if not isinstance(part, Method):
        return "is no Method"
    if wrong := wrong_settings(part.settings, MethodSettings):
        return f"has settings that cannot be used: {part.settings.__name__} {wrong}"
    asked = ("before_first", "until_value_falls", "limit", "propose")
    if missing := lacking(part.stitcher, asked):
        return (
            f"has a stitcher whose class has no {missing!r}: a property or class attribute, for "
            "setting it in __init__ is not enough"
        )
    return ""


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
    _wrong,
)

for _name, _method in METHODS.items():
    _alike = [name for name, method in METHODS.items() if method.label == _method.label]
    if len(_alike) > 1:
        raise PartError(f"{' and '.join(_alike)} have the same label, {_method.label!r}")

"""Frames of an episode, drawn by a process of its own: see `analysis.render`."""

import json
import os
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from analysis.backends import PLATFORMS, backends
from analysis.figures.showcase.scenes import NoPictureError

MOST_SECONDS = 300  # to start and draw a sheet; a driver that hangs must not hang the report
SECONDS_A_FRAME = 2.0  # more, for each


def render_frames(scene: Mapping[str, Any], positions: np.ndarray) -> np.ndarray:
    """(N, nq) generalised positions -> (N, height, width, 3) uint8, or NoPictureError."""
    with TemporaryDirectory() as folder:
        names = ("scene.json", "positions.npy", "frames.npy")
        described, recorded, drawn = (Path(folder) / name for name in names)
        described.write_text(json.dumps(scene), encoding="utf-8")
        np.save(recorded, positions)
        complaints = []
        for backend in backends():
            seconds = MOST_SECONDS + SECONDS_A_FRAME * len(positions)
            complaint = _render(backend, seconds, described, recorded, drawn)
            if not complaint:
                return np.asarray(np.load(drawn))
            if "No module named 'mujoco'" in complaint:
                raise NoPictureError("mujoco is not installed; install it, and libegl1")
            complaints.append(f"{backend}: {complaint}")
    raise NoPictureError(
        f"MuJoCo cannot draw here ({'; '.join(complaints)}); install libegl1 or libosmesa6"
    )


def _render(backend: str, seconds: float, *files: Path) -> str:
    """Draws with one of MuJoCo's backends; returns why not, if not."""
    try:
        run = subprocess.run(
            [sys.executable, "-m", "analysis.render", *map(str, files)],
            env=os.environ | {"MUJOCO_GL": backend, "PYOPENGL_PLATFORM": PLATFORMS[backend]},
            cwd=Path(__file__).parents[3],
            capture_output=True,
            text=True,
            timeout=seconds,
        )
    except subprocess.TimeoutExpired:
        return f"took more than {seconds:.0f} s"
    if run.returncode == 0:
        return ""
    said = run.stderr.strip().splitlines()
    return said[-1] if said else f"exit status {run.returncode}"

"""Frames of the Kitchen, drawn by a process of its own: see `analysis.render`."""

import os
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

MODEL = "envs/assets/kitchen_franka/kitchen_assets/kitchen_env_model.xml"
BACKENDS = ("egl", "osmesa")  # of MuJoCo, those that need no display
MOST_SECONDS = 300  # of drawing; a driver that hangs must not hang the report


class NoPictureError(Exception):
    """There is no drawing here; the message says why and what to install."""


def render_frames(positions: np.ndarray) -> np.ndarray:
    """(N, 30) generalised positions -> (N, height, width, 3) uint8, or NoPictureError."""
    model = _model_file()
    with TemporaryDirectory() as folder:
        given, drawn = Path(folder) / "positions.npy", Path(folder) / "frames.npy"
        np.save(given, positions)
        complaints = []
        for backend in BACKENDS:
            complaint = _render(backend, model, given, drawn)
            if not complaint:
                return np.asarray(np.load(drawn))
            if "No module named 'mujoco'" in complaint:
                raise NoPictureError("mujoco is not installed; install it, and libegl1")
            complaints.append(f"{backend}: {complaint}")
    raise NoPictureError(
        f"MuJoCo cannot draw here ({'; '.join(complaints)}); install libegl1 or libosmesa6"
    )


def _model_file() -> Path:
    package = find_spec("gymnasium_robotics")  # importing it prints, and is slow
    if package is None or package.origin is None:
        raise NoPictureError("gymnasium-robotics, which has the model, is not installed")
    return Path(package.origin).parent / MODEL


def _render(backend: str, model: Path, positions: Path, target: Path) -> str:
    """Draws with one of MuJoCo's backends; returns why not, if not."""
    try:
        run = subprocess.run(
            [sys.executable, "-m", "analysis.render", str(model), str(positions), str(target)],
            env={**os.environ, "MUJOCO_GL": backend, "PYOPENGL_PLATFORM": backend},
            cwd=Path(__file__).parents[2],
            capture_output=True,
            text=True,
            timeout=MOST_SECONDS,
        )
    except subprocess.TimeoutExpired:
        return f"took more than {MOST_SECONDS} s"
    if run.returncode == 0:
        return ""
    said = run.stderr.strip().splitlines()
    return said[-1] if said else f"exit status {run.returncode}"

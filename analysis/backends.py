"""Which of MuJoCo's ways to draw are tried, and in which order."""

import os

PLATFORMS = {"egl": "egl", "osmesa": "osmesa", "glfw": "glx"}  # PyOpenGL's names for them
WITHOUT_DISPLAY = ("egl", "osmesa")
CHOSEN = "SKILLSTITCH_MUJOCO_GL"  # the user's MUJOCO_GL, where a command has set that aside


def backends() -> list[str]:
    """Values of MUJOCO_GL: the one that the user has set, if it is one, then those here."""
    chosen = os.environ.get(CHOSEN) or os.environ.get("MUJOCO_GL", "")
    first = [name for name in PLATFORMS if name == chosen.lower().strip()]
    return list(dict.fromkeys([*first, *WITHOUT_DISPLAY]))

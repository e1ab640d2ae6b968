"""How each benchmark is looked at: which model, and from where."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any, TypeVar

from analysis.schema import kind_of


class NoPictureError(Exception):
    """There is no drawing here; the message says why and what to install."""


@dataclass(frozen=True)
class Camera:
    """Where a scene is looked at from."""

    lookat: tuple[float, float, float]  # m
    distance: float  # m
    azimuth: float  # degrees, as the next
    elevation: float


@dataclass(frozen=True)
class View:
    """How a benchmark's scene is drawn."""

    camera: Camera
    package: str  # whose folder has the model, or else its meshes and textures
    distribution: str  # what to install for it
    file: str = ""  # the model, in that folder; without it a showcase tells the model itself
    visual_only: bool = False  # the model has shapes that are not for the eye
    note: str = ""  # what a reader would wonder at


VIEWS = {
    "kitchen": View(
        Camera((-0.2, 0.5, 2.02), 2.3, 82.0, -25.0),
        "gymnasium_robotics",
        "gymnasium-robotics",
        "envs/assets/kitchen_franka/kitchen_assets/kitchen_env_model.xml",
    ),
    "robosuite-door": View(
        Camera((-0.25, -0.25, 1.1), 1.4, 225.0, -35.0), "robosuite", "robosuite", visual_only=True
    ),
    "robosuite-can": View(
        Camera((0.05, 0.02, 1.02), 1.6, 150.0, -32.0),
        "robosuite",
        "robosuite",
        visual_only=True,
        note="A can in its place is taken away, and another one comes.",
    ),
}


T = TypeVar("T")


def drawing_of(drawings: Mapping[str, T], showcase: Mapping[str, Any]) -> T:
    """What draws a recording. NoPictureError where nothing here does."""
    kind = kind_of(showcase)
    if kind not in drawings:
        raise NoPictureError(f"recordings of the kind {kind!r} cannot be drawn here")
    return drawings[kind]


def scene_of(showcase: Mapping[str, Any], episode: Mapping[str, Any]) -> dict[str, Any]:
    """What `analysis.render` is told of an episode, as JSON."""
    view = VIEWS.get(showcase["benchmark"])
    if view is None:
        raise NoPictureError(f"analysis.figures has no view of {showcase['benchmark']}")
    if not view.file and "model" not in showcase:
        raise NoPictureError("the run is older than pictures of it; run it again")
    return {
        "path": str(_folder(view) / view.file),
        "xml": "" if view.file else showcase["model"],
        "camera": asdict(view.camera),
        "visual_only": view.visual_only,
        "fixtures": episode.get("fixtures", {}),
    }


def _folder(view: View) -> Path:
    package = find_spec(view.package)  # importing it prints, and is slow
    if package is None or package.origin is None:
        raise NoPictureError(f"{view.distribution}, which has the model, is not installed")
    return Path(package.origin).parent

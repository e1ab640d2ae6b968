"""What a renderer needs beside an episode's positions: the model, and what in it is the episode's.

Kitchen's model is a file of its package, so nothing needs telling. Robosuite composes a model for
each task, and a door's place belongs to the model.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from importlib.util import find_spec
from os.path import normpath
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from stitching.envs.protocol import VectorEnv
from stitching.envs.robosuite.can import CAN
from stitching.envs.robosuite.door import DOOR
from stitching.envs.robosuite.models import composed, original

PACKAGE = "robosuite"  # whose folder has the meshes and textures


@dataclass(frozen=True)
class Scenery:
    """Which of robosuite's models shows an episode, and what in it differs by episode."""

    task: str  # robosuite's name
    body: str = ""  # stands where the last seven numbers of a snapshot say: m, w x y z

    def model(self) -> str:
        """The model as XML, files relative to their package's folder."""
        return portable(self.task)

    def fixtures(self, env: VectorEnv, row: int) -> dict[str, list[float]]:
        """Poses of bodies that are the model's and differ by episode."""
        if not self.body:
            return {}
        pose = env.snapshot(np.array([row]))[0, -7:]
        if not np.isfinite(pose).all():  # its physics have diverged, and it shows nothing more
            return {}
        return {self.body: [round(x, 6) for x in pose.tolist()]}


SCENERIES = {DOOR.name: Scenery("Door", "Door_main"), CAN.name: Scenery("PickPlaceCan")}


@cache
def portable(task: str) -> str:
    """What `arm_model` compiles, as text that means the same on another machine."""
    tree = composed(original(task))
    folder = _package_folder()
    for asset in tree.iterfind("asset/*[@file]"):
        asset.attrib["file"] = Path(normpath(asset.attrib["file"])).relative_to(folder).as_posix()
    return ElementTree.tostring(tree, encoding="unicode")


def _package_folder() -> Path:
    package = find_spec(PACKAGE)
    assert package is not None
    assert package.origin is not None
    return Path(package.origin).parent

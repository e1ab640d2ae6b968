"""Pictures of recorded states: `python -m analysis.render scene.json positions.npy frames.npy`.

A process of its own, because MuJoCo reads MUJOCO_GL when it is imported. It is the only module
here that loads the simulator, no other imports it, and it simulates nothing. What a scene is, is
told by `analysis.figures.showcase.scenes`.
"""

import json
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

HEIGHT, WIDTH = 300, 400  # pixels
SKY = 236  # grey of what lies behind; Kitchen's own is a starry night


def render(scene: Mapping[str, Any], positions: np.ndarray) -> np.ndarray:
    """(N, nq) generalised positions -> (N, HEIGHT, WIDTH, 3) uint8."""
    model = load_model(scene)
    data = mujoco.MjData(model)
    camera, option = mujoco.MjvCamera(), mujoco.MjvOption()
    for name, value in scene["camera"].items():
        setattr(camera, name, value)
    if scene["visual_only"]:
        option.geomgroup[0] = 0
        option.sitegroup[:] = 0
    frames = np.empty((len(positions), HEIGHT, WIDTH, 3), dtype=np.uint8)
    with mujoco.Renderer(model, HEIGHT, WIDTH) as renderer:
        for frame, at in zip(frames, positions, strict=True):
            data.qpos[:] = at
            mujoco.mj_forward(model, data)
            renderer.update_scene(data, camera, option)
            # Hard shadows hide the arm, and take ten times as long without a graphics card.
            renderer.scene.flags[mujoco.mjtRndFlag.mjRND_SHADOW] = False
            renderer.render(out=frame)
    return frames


def load_model(scene: Mapping[str, Any]) -> mujoco.MjModel:
    """The scene's model, what is fixed in it where the episode had it, under a plain sky."""
    if scene["xml"]:
        spec = mujoco.MjSpec.from_string(scene["xml"])
        spec.meshdir = spec.texturedir = scene["path"]
        model = spec.compile()
    else:
        model = mujoco.MjModel.from_xml_path(scene["path"])
    for name, pose in scene["fixtures"].items():
        body = model.body(name)
        body.pos[:], body.quat[:] = pose[:3], pose[3:]
    for texture in np.flatnonzero(model.tex_type == mujoco.mjtTexture.mjTEXTURE_SKYBOX):
        start = model.tex_adr[texture]
        pixels = model.tex_height[texture] * model.tex_width[texture]
        model.tex_data[start : start + pixels * model.tex_nchannel[texture]] = SKY
    return model


if __name__ == "__main__":
    described, recorded, target = map(Path, sys.argv[1:])
    np.save(target, render(json.loads(described.read_text(encoding="utf-8")), np.load(recorded)))

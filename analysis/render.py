"""Pictures of the Kitchen: `python -m analysis.render model.xml positions.npy frames.npy`.

A process of its own, because MuJoCo reads MUJOCO_GL when it is imported. It is the only module
here that loads the simulator, no other imports it, and it simulates nothing.
"""

import sys
from pathlib import Path

import mujoco
import numpy as np

HEIGHT, WIDTH = 300, 400  # pixels
LOOKAT, DISTANCE, AZIMUTH, ELEVATION = (-0.2, 0.5, 2.02), 2.3, 82.0, -25.0
SKY = 236  # grey of what lies behind the kitchen; the model's own is a starry night


def render(model_file: Path, positions: np.ndarray) -> np.ndarray:
    """(N, nq) generalised positions -> (N, HEIGHT, WIDTH, 3) uint8."""
    model = mujoco.MjModel.from_xml_path(str(model_file))
    for texture in np.flatnonzero(model.tex_type == mujoco.mjtTexture.mjTEXTURE_SKYBOX):
        start = model.tex_adr[texture]
        pixels = model.tex_height[texture] * model.tex_width[texture]
        model.tex_data[start : start + pixels * model.tex_nchannel[texture]] = SKY
    data = mujoco.MjData(model)
    camera = mujoco.MjvCamera()
    camera.lookat[:] = LOOKAT
    camera.distance, camera.azimuth, camera.elevation = DISTANCE, AZIMUTH, ELEVATION
    frames = np.empty((len(positions), HEIGHT, WIDTH, 3), dtype=np.uint8)
    with mujoco.Renderer(model, HEIGHT, WIDTH) as renderer:
        for frame, at in zip(frames, positions, strict=True):
            data.qpos[:] = at
            mujoco.mj_forward(model, data)
            renderer.update_scene(data, camera)
            # Hard shadows hide the arm, and take ten times as long without a graphics card.
            renderer.scene.flags[mujoco.mjtRndFlag.mjRND_SHADOW] = False
            renderer.render(out=frame)
    return frames


if __name__ == "__main__":
    model_file, positions, target = map(Path, sys.argv[1:])
    np.save(target, render(model_file, np.load(positions)))

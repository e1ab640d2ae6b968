"""What a renderer is told: the model that is simulated, and where the episode's door stands."""

from importlib.util import find_spec
from pathlib import Path

import mujoco
import numpy as np
import pytest

from stitching.envs.robosuite.can import CAN, Can
from stitching.envs.robosuite.door import DOOR, Door
from stitching.studies.showcase.scenery import SCENERIES


def compiled(scene: Door | Can) -> mujoco.MjModel:
    package = find_spec("robosuite")
    assert package is not None
    assert package.origin is not None
    spec = mujoco.MjSpec.from_string(SCENERIES[scene.name].model())
    spec.meshdir = spec.texturedir = str(Path(package.origin).parent)
    return spec.compile()


@pytest.mark.parametrize("scene", [DOOR, CAN], ids=["door", "can"])
def test_everything_is_where_the_block_has_it(scene: Door | Can) -> None:
    told, env, rows = compiled(scene), scene.vector_env(), np.arange(2)
    env.reset([np.random.default_rng(seed) for seed in rows])
    data = mujoco.MjData(told)
    for row, at in zip(rows, env.positions(rows), strict=True):
        for name, pose in SCENERIES[scene.name].fixtures(env, row).items():
            told.body(name).pos[:], told.body(name).quat[:] = pose[:3], pose[3:]
        data.qpos[:] = at
        mujoco.mj_kinematics(told, data)
        seen = np.array(scene.objects(data))
        np.testing.assert_allclose(seen, env.observe(np.array([row]))[0, 11:], atol=1e-5)


@pytest.mark.parametrize("scene", [DOOR, CAN], ids=["door", "can"])
def test_the_model_means_the_same_on_another_machine(scene: Door | Can) -> None:
    text = SCENERIES[scene.name].model()
    assert str(Path.cwd()) not in text
    assert 'file="/' not in text
    assert "Milk" not in text.partition("<worldbody>")[2]


def test_each_episode_has_a_door_of_its_own() -> None:
    env = DOOR.vector_env()
    env.reset([np.random.default_rng(seed) for seed in range(2)])
    first, second = (SCENERIES[DOOR.name].fixtures(env, row) for row in range(2))
    assert list(first) == list(second) == ["Door_main"]
    assert first != second


def test_a_can_needs_no_fixture() -> None:
    env = CAN.vector_env()
    env.reset([np.random.default_rng(0)])
    assert SCENERIES[CAN.name].fixtures(env, 0) == {}

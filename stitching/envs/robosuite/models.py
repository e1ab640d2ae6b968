"""The models robosuite composes, compiled once a process, and where things are in them."""

from __future__ import annotations

import logging
from dataclasses import dataclass
from functools import cache
from typing import Any
from xml.etree import ElementTree

import mujoco
import numpy as np

ARM = 7  # joints; they come first in positions and velocities, the two fingers next
FINGERS = slice(7, 9)
HOME = np.array([0, np.pi / 16, 0, -np.pi / 2 - np.pi / 3, 0, np.pi - 0.2, np.pi / 4])  # rad
FINGERS_HOME = np.array([0.020833, -0.020833])  # m

# Bodies that PickPlaceCan parks at (10, 10, 10), where they fall to the floor and lie, and what
# marks their places. Without them a substep takes seven tenths of the time.
UNUSED = ("Milk", "Bread", "Cereal", "Visual")


@dataclass(frozen=True, eq=False)
class ArmModel:
    """A compiled model and the ids of the robot's parts in it."""

    mujoco: mujoco.MjModel
    grip: int  # site between the finger tips
    hand: int  # body
    torque_limits: np.ndarray  # (2, 7) N m, lower and upper


def original(task: str, **options: Any) -> Any:
    """robosuite's own environment, poses of the gripper in the world as actions, at 10 Hz."""
    before = logging.root.manager.disable
    logging.disable(logging.WARNING)  # it warns of robots and settings that nobody asked for
    try:
        import robosuite
        from robosuite.controllers import load_composite_controller_config

        config = load_composite_controller_config(robot="Panda")
        config["body_parts"]["right"] |= {"input_type": "absolute", "input_ref_frame": "world"}
        return robosuite.make(
            task,
            robots="Panda",
            controller_configs=config,
            control_freq=10,
            has_renderer=False,
            has_offscreen_renderer=False,
            use_camera_obs=False,
            ignore_done=True,
            hard_reset=False,
            **options,
        )
    finally:
        logging.disable(before)


def composed(env: Any) -> ElementTree.Element:
    """The model of robosuite's environment as XML, files by their paths here, less the UNUSED."""
    tree = ElementTree.fromstring(env.edit_model_xml(env.model.get_xml()))
    world = tree.find("worldbody")
    assert world is not None
    for body in world.findall("body"):
        if body.attrib["name"].startswith(UNUSED):
            world.remove(body)
    return tree


@cache
def arm_model(task: str) -> ArmModel:
    """For reading, and for MjData of one's own; objects without a joint may be moved about."""
    env = original(task)
    theirs = env.sim.model._model
    model = mujoco.MjModel.from_xml_string(ElementTree.tostring(composed(env), encoding="unicode"))
    # The solver stops by a tolerance relative to these two's product: the same as theirs.
    model.stat.meaninertia = theirs.stat.meaninertia * theirs.nv / model.nv
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_SENSOR)  # nobody reads them
    # Else MuJoCo writes a MUJOCO_LOG.TXT into whatever directory the worker stands in.
    mujoco.set_mju_user_warning(logging.getLogger(__name__).warning)
    return ArmModel(
        model,
        grip=model.site("gripper0_right_grip_site").id,
        hand=model.body("robot0_right_hand").id,
        torque_limits=model.actuator_ctrlrange[:ARM].T.copy(),
    )

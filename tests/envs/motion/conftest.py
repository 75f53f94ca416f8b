from dataclasses import dataclass

import numpy as np
import pytest

from lerobot_bimanual.arms import ARMS
from lerobot_env_bimanual.gl import mujoco
from lerobot_env_bimanual.props.block import Block
from lerobot_env_bimanual.robots.kinematics import ArmKinematics
from lerobot_env_bimanual.robots.panda_pair import PANDA_PAIR
from lerobot_env_bimanual.world.scene import Scene


@dataclass(frozen=True)
class Wall:
    """A thin static wall across the left arm's side of the table."""

    name: str = "wall"

    def add_to(self, spec: mujoco.MjSpec) -> None:
        body = spec.worldbody.add_body(name=self.name)
        body.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=(0.20, 0.01, 0.20))


@pytest.fixture(scope="session", params=ARMS, ids=str)
def kinematics(request) -> ArmKinematics:
    return PANDA_PAIR.kinematics[request.param]


@pytest.fixture(scope="session")
def postures() -> np.ndarray:
    """(50, 7) random joints inside the limits."""
    lower, upper = PANDA_PAIR.joint_lower + 0.05, PANDA_PAIR.joint_upper - 0.05
    return np.random.default_rng(0).uniform(lower, upper, (50, 7))


@pytest.fixture
def furnished_scene(scene_of) -> Scene:
    """Arms at home, a block and a wall that the test places."""
    return scene_of(Block("block"), Wall())

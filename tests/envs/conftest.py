"""Environments that several files share."""

from collections.abc import Callable

import numpy as np
import pytest

from lerobot_bimanual.arms import ARMS
from lerobot_bimanual.keypose import BimanualKeypose, Keypose
from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.world.scene import Scene

TASK = "lift_ball"


@pytest.fixture(scope="module")
def state_env():
    env = BimanualEnv(TASK, obs="state")
    yield env
    env.close()


@pytest.fixture(scope="module")
def rgbd_env():
    env = BimanualEnv(TASK, image_size=(24, 32))
    yield env
    env.close()


@pytest.fixture(scope="session")
def _empty_scene() -> Scene:
    return Scene()


@pytest.fixture
def scene(_empty_scene) -> Scene:
    """Arms only, at home."""
    _empty_scene.reset()
    return _empty_scene


@pytest.fixture(scope="module")
def instant_placement():
    """Take the first placement as it is drawn; rehearsing it is most of a reset's time."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("lerobot_env_bimanual.episode.rehearsal.Rehearsal.infeasibility", lambda *_: None)
        yield


@pytest.fixture
def keypose_below() -> Callable[..., np.ndarray]:
    """Gives a keypose with both hands straight down from where they are."""

    def keypose(env: BimanualEnv, drop_m: float = 0.1, gripper_open: bool = True) -> np.ndarray:
        targets = [env.scene.tcp(arm).translated((0.0, 0.0, -drop_m)) for arm in ARMS]
        return BimanualKeypose(*(Keypose(target, gripper_open, True) for target in targets)).to_vector()

    return keypose

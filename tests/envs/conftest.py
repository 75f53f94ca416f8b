"""Environments that several files share."""

from collections.abc import Callable
from functools import cache

import numpy as np
import pytest

from lerobot_bimanual.arms import ARMS
from lerobot_bimanual.keypose import BimanualKeypose, Keypose
from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.props.prop import Prop
from lerobot_env_bimanual.world.scene import Scene

TASK = "lift_ball"


@pytest.fixture(scope="module")
def state_env():
    return BimanualEnv(TASK, obs="state")


_compiled = cache(lambda *props: Scene(props))


@pytest.fixture
def scene_of() -> Callable[..., Scene]:
    """Gives the scene of some props, which is compiled once, after a reset."""

    def scene(*props: Prop) -> Scene:
        _compiled(*props).reset()
        return _compiled(*props)

    return scene


@pytest.fixture
def scene(scene_of) -> Scene:
    """Arms only, at home."""
    return scene_of()


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

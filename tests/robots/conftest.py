"""A robot without cameras."""

from collections.abc import Callable, Iterator

import pytest

from lerobot_robot_bimanual.bimanual_sim import BimanualSim
from lerobot_robot_bimanual.config_bimanual_sim import BimanualSimConfig


@pytest.fixture
def make_robot(tmp_path) -> Iterator[Callable[..., BimanualSim]]:
    """Makes robots, connected if nothing else is asked for, and without cameras."""
    robots: list[BimanualSim] = []

    def make(connected: bool = True, **options) -> BimanualSim:
        config = BimanualSimConfig(**{"obs": "state", "calibration_dir": tmp_path} | options)
        robots.append(BimanualSim(config))
        if connected:
            robots[-1].connect()
        return robots[-1]

    yield make
    for robot in robots:
        if robot.is_connected:
            robot.disconnect()

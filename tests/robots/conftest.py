"""A robot without cameras, and a terminal that a test types into."""

import os
import pty
import sys
import time
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


@pytest.fixture
def keyboard(monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[[str], object]]:
    """Types into the terminal that is standard input."""
    master, slave = pty.openpty()
    with os.fdopen(slave) as terminal:
        monkeypatch.setattr(sys, "stdin", terminal)
        yield lambda text: os.write(master, text.encode())
    os.close(master)


@pytest.fixture
def soon() -> Callable[[Callable[[], object]], object]:
    """Waits for another thread: the first true answer, or the last one after many."""

    def wait(ask: Callable[[], object]) -> object:
        for _ in range(500):
            if answer := ask():
                return answer
            time.sleep(0.01)
        return ask()

    return wait

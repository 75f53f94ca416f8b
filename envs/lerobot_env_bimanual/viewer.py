"""MuJoCo's interactive viewer: episodes in real time, one seed after the other."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, ExitStack, contextmanager, suppress
from itertools import count

from mujoco import MjData, MjModel, viewer
from numpy.typing import NDArray

from lerobot_bimanual.errors import PlacementFailure
from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.experts.runner import Player, run_episode
from lerobot_env_bimanual.world.appearance import applied
from lerobot_env_bimanual.world.servo_commands import TICK_S

END_S = 2.0
"""For which the end of an episode stays."""
FIRST_VIEW = {"distance": 2.0, "azimuth": 180.0, "elevation": -30.0}
LOOK_AT_M = (0.2, 0.0, 0.9)
"""First view of the window, in m and degrees: roughly that of the front camera, from a little higher."""


@contextmanager
def mujoco_window(model: MjModel, data: MjData) -> Iterator[viewer.Handle]:
    """MuJoCo's own window, in a thread of its own that ends with the `with` block."""
    others = threading.enumerate()
    window = viewer.launch_passive(model, data, show_left_ui=False, show_right_ui=False)
    threads = [thread for thread in threading.enumerate() if thread not in others]
    try:
        yield window
    finally:
        window.close()
        for thread in threads:  # one that outlives the interpreter crashes it
            thread.join()


class _Closed(BaseException):
    """Leaves an episode in its middle; not an `Exception`, so that no code on the way handles it."""


def watch(
    env: BimanualEnv,
    player: Player,
    first_seed: int,
    open_window: Callable[..., AbstractContextManager[viewer.Handle]] = mujoco_window,
    sleep: Callable[[float], None] = time.sleep,
) -> None:
    """Play episodes until their window is closed; those with other things in them have a window of their own.

    Args:
        env: whose episodes are played.
        player: the policy or expert.
        first_seed: seed of the first episode; the others follow, and the variation is left to the options.
        open_window: MuJoCo's window, or a replacement.
        sleep: waits for some seconds.
    """
    scene, due_s = None, 0.0
    windows = ExitStack()

    def show(env: BimanualEnv, _: NDArray | None = None) -> None:
        """Draw the state, and wait until it is time for the next."""
        nonlocal scene, window, due_s
        if env.scene is not scene:
            windows.close()
            scene = env.scene
            window = windows.enter_context(open_window(scene.model, scene.data))
            window.cam.lookat[:] = LOOK_AT_M
            for name, value in FIRST_VIEW.items():
                setattr(window.cam, name, value)
        if not window.is_running():
            raise _Closed
        text = f"{env.task_description}\nseed {env.progress.seed}, variation {env.variation}"
        window.set_texts((None, None, f"{text}\n{env.progress.ticks * TICK_S:.1f} s", ""))
        with applied(env.scene.model, env.scene.data, env.scene.appearance.fields):
            window.sync()
        due_s = max(due_s + TICK_S, time.monotonic() - TICK_S)
        sleep(max(0.0, due_s - time.monotonic()))

    window: viewer.Handle
    with windows, env.observed_by(show), suppress(_Closed):
        for seed in count(first_seed):
            with suppress(PlacementFailure):
                run_episode(env, seed, player)
                show(env)
                sleep(END_S)

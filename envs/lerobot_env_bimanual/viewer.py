"""MuJoCo's interactive viewer: episodes in real time, with keys for other seeds."""

from __future__ import annotations

import contextlib
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from queue import SimpleQueue

from mujoco import MjData, MjModel, viewer

from lerobot_bimanual.errors import PlacementFailure
from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.experts.runner import Player, run_episode
from lerobot_env_bimanual.world.appearance import applied
from lerobot_env_bimanual.world.scene import Scene
from lerobot_env_bimanual.world.servo_commands import TICK_S

RIGHT, LEFT = 262, 263
"""Codes of GLFW for the arrow keys."""
KEYS = "right/left: the next seed, or the one before"
POLL_S = 0.05
"""Interval at which keys are read after an episode."""
FIRST_VIEW = {"distance": 2.0, "azimuth": 180.0, "elevation": -30.0}
LOOK_AT_M = (0.2, 0.0, 0.9)
"""First view of the window, in m and degrees: roughly that of the front camera, from a little higher."""


type OpenWindow = Callable[..., AbstractContextManager[viewer.Handle]]
"""Opens a window on a model and its data; `key_callback` is given the code of every key."""


@contextmanager
def mujoco_window(
    model: MjModel, data: MjData, key_callback: Callable[[int], None] | None = None
) -> Iterator[viewer.Handle]:
    """MuJoCo's own window, in a thread of its own that ends with the `with` block."""
    others = threading.enumerate()
    window = viewer.launch_passive(
        model, data, key_callback=key_callback, show_left_ui=False, show_right_ui=False
    )
    threads = [thread for thread in threading.enumerate() if thread not in others]
    try:
        yield window
    finally:
        window.close()
        for thread in threads:  # one that outlives the interpreter crashes it
            thread.join()


class _EpisodeLeft(BaseException):
    """Leaves an episode in its middle; not an `Exception`, so that no code on the way handles it."""


class Performance:
    """Plays episodes in a window until it is closed.

    Args:
        env: whose episodes are played.
        player: the policy or expert.
        name: of the player, as it is shown.
        first_seed: seed of the first episode; its variation is left to the options.
        open_window: MuJoCo's window, or a replacement.
        sleep: waits for some seconds.
    """

    def __init__(
        self,
        env: BimanualEnv,
        player: Player,
        name: str,
        first_seed: int,
        open_window: OpenWindow = mujoco_window,
        sleep: Callable[[float], None] = time.sleep,
    ):
        self._env, self._player, self._name, self._seed = env, player, name, first_seed
        self._open_window, self._sleep = open_window, sleep
        self._keys: SimpleQueue[int] = SimpleQueue()
        self._due_s = 0.0

    def run(self) -> None:
        """Play until the window is closed; episodes with other things in them have a window of their own.

        Raises:
            InvalidChoice: the perturbation finds nothing to change in the task.
        """
        while self._play_in_window(self._env.scene):
            pass

    def _play_in_window(self, scene: Scene) -> bool:
        """Play until the window is closed, or an episode has another scene; says whether the latter."""
        self._scene = scene
        with self._open_window(scene.model, scene.data, key_callback=self._keys.put) as self._window:
            camera = self._window.cam
            camera.lookat[:] = LOOK_AT_M
            for name, value in FIRST_VIEW.items():
                setattr(camera, name, value)
            while self._window.is_running():
                if self._env.scene is not scene:
                    return True
                with contextlib.suppress(_EpisodeLeft):
                    verdict = self._play()
                    while True:  # the last state stays until another episode is requested
                        self._show(verdict)
                        self._sleep(POLL_S)
        return False

    def _play(self) -> str:
        self._due_s = time.monotonic()
        try:
            with self._env.observed_by(lambda *_: self._tick()):
                outcome = run_episode(self._env, self._seed, self._player)
        except PlacementFailure as failure:
            return str(failure)
        return "solved" if outcome.success else f"not solved: {outcome.failure}"

    def _tick(self) -> None:
        """Before every tick: show the state, and wait until it is time for the next."""
        self._show(f"{self._env.progress.ticks * TICK_S:.1f} s")
        self._due_s = max(self._due_s + TICK_S, time.monotonic() - TICK_S)
        self._sleep(max(0.0, self._due_s - time.monotonic()))

    def _show(self, state: str) -> None:
        """Draw, and leave the episode if its window is closed, or is that of other things, or another one is requested."""
        env, window, scene = self._env, self._window, self._scene
        if env.scene is not scene or not window.is_running():
            raise _EpisodeLeft
        world = f"with {env.options.perturb}" if env.options.perturb else "nominal"
        episode = f"{self._name}, seed {env.progress.seed}, variation {env.variation}, {world}"
        window.set_texts((None, None, f"{env.task_description}\n{episode}\n{state}\n{KEYS}", ""))
        with applied(scene.model, scene.data, scene.appearance.fields):
            window.sync()
        while not self._keys.empty():
            key = self._keys.get()
            if key in (RIGHT, LEFT):
                self._seed = max(0, self._seed + (1 if key == RIGHT else -1))
                raise _EpisodeLeft

"""MuJoCo's interactive viewer: episodes played in real time before somebody who may ask for others."""

from __future__ import annotations

import os
import time
import warnings
from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import dataclass
from enum import IntEnum
from queue import Empty, SimpleQueue
from typing import Any, Protocol

from lerobot_bimanual.errors import PlacementFailure
from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.expert.runner import Player, run_episode
from lerobot_env_bimanual.world.servo_commands import TICK_S


class Key(IntEnum):
    """Codes of GLFW."""

    SPACE = 32
    BACKSPACE = 259
    RIGHT = 262
    LEFT = 263
    DOWN = 264
    UP = 265


KEYS = "right/left: seed   up/down: variation   space: pause   backspace: again"
PATIENCE_S = 0.05
"""Between two looks at the keys while nothing moves."""


LOOK_AT_M, DISTANCE_M, AZIMUTH_DEG, ELEVATION_DEG = (0.2, 0.0, 0.9), 2.0, 180.0, -30.0
"""Where the viewer looks from at first: roughly the front camera's place, a little higher."""


class Window(Protocol):
    """What is used of MuJoCo's handle of a viewer."""

    @property
    def cam(self) -> Any:
        """From where the scene is seen, an `MjvCamera`."""
        ...

    def is_running(self) -> bool:
        """Whether nobody has closed it."""
        ...

    def sync(self) -> None:
        """Show the present state."""
        ...

    def set_texts(self, texts: tuple[None, None, str, str]) -> None:
        """Write into a corner: font, place, left column, right column."""
        ...


type OpenWindow = Callable[..., AbstractContextManager[Window]]
"""Opens a window on a model and its data, with `key_callback`, which is told the code of every key."""


@dataclass(frozen=True)
class Wish:
    """Which episode to play.

    Attributes:
        seed: of the reset.
        variation: index; None leaves it to the environment's options.
    """

    seed: int
    variation: int | None = None

    def after(self, key: int, shown: int, variations: int) -> Wish | None:
        """The episode that a key asks for; None if the key asks for none.

        Args:
            key: code of GLFW.
            shown: variation of the present episode.
            variations: how many the task has.
        """
        match key:
            case Key.RIGHT | Key.LEFT:
                return Wish(max(0, self.seed + (1 if key == Key.RIGHT else -1)), self.variation)
            case Key.DOWN | Key.UP:
                return Wish(self.seed, (shown + (1 if key == Key.UP else -1)) % variations)
            case Key.BACKSPACE:
                return self
        return None


class _OtherEpisode(BaseException):
    """Leaves an episode in its middle; no error, so that nobody on the way takes it for one."""

    def __init__(self, wish: Wish | None):
        self.wish = wish


def no_window() -> str:
    """Why no window can be opened; "" if one can."""
    if "DISPLAY" not in os.environ and "WAYLAND_DISPLAY" not in os.environ:
        return "there is no display"
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # it says the same in its own words
        import glfw

        return "" if glfw.init() else "the display cannot be opened"


def mujoco_window() -> OpenWindow:
    """MuJoCo's own, which runs in a thread beside ours."""
    import mujoco.viewer

    def open_window(model: object, data: object, key_callback: Callable[[int], None]):
        return mujoco.viewer.launch_passive(
            model, data, key_callback=key_callback, show_left_ui=False, show_right_ui=False
        )

    return open_window


class Performance:
    """Plays episodes in a window until it is closed.

    Args:
        env: whose world is shown.
        player: who plays.
        name: of the player, as it is shown.
        wish: the first episode.
        open_window: MuJoCo's viewer, or what stands for it.
        sleep: waits for some seconds.
    """

    def __init__(
        self,
        env: BimanualEnv,
        player: Player,
        name: str,
        wish: Wish,
        open_window: OpenWindow,
        sleep: Callable[[float], None] = time.sleep,
    ):
        self._env, self._player, self._name = env, player, name
        self._wish: Wish | None = wish
        self._open_window, self._sleep = open_window, sleep
        self._keys: SimpleQueue[int] = SimpleQueue()
        self._paused = False
        self._due_s = 0.0

    def run(self) -> None:
        """Play until the window is closed."""
        scene = self._env.scene
        with self._open_window(scene.model, scene.data, key_callback=self._keys.put) as self._window:
            camera = self._window.cam
            camera.lookat[:], camera.distance = LOOK_AT_M, DISTANCE_M
            camera.azimuth, camera.elevation = AZIMUTH_DEG, ELEVATION_DEG
            while self._wish is not None:
                try:
                    verdict = self._play(self._wish)
                    while True:  # the last state stays until somebody asks for another episode
                        self._show(verdict)
                        self._sleep(PATIENCE_S)
                except _OtherEpisode as other:
                    self._wish = other.wish

    def _play(self, wish: Wish) -> str:
        self._due_s = time.monotonic()
        try:
            with self._env.observed_by(lambda *_: self._tick()):
                outcome = run_episode(self._env, wish.seed, self._player, variation=wish.variation)
        except PlacementFailure as failure:
            return str(failure)
        return "solved" if outcome.success else f"not solved: {outcome.failure}"

    def _tick(self) -> None:
        """Before every tick: show the state, and wait until it is time for the next."""
        self._show(f"{self._env.progress.ticks * TICK_S:.1f} s")
        while self._paused:
            self._show("paused")
            self._sleep(PATIENCE_S)
            self._due_s = time.monotonic()
        self._due_s = max(self._due_s + TICK_S, time.monotonic() - TICK_S)
        self._sleep(max(0.0, self._due_s - time.monotonic()))

    def _show(self, state: str) -> None:
        """Draw, and leave the episode if the window was closed or somebody wishes another."""
        env, window = self._env, self._window
        if not window.is_running():
            raise _OtherEpisode(None)
        text = f"{env.task_description}\n{self._name}, seed {env.progress.seed}, variation {env.variation}"
        window.set_texts((None, None, f"{text}\n{state}\n{KEYS}", ""))
        window.sync()
        while (key := self._next_key()) is not None:
            if key == Key.SPACE:
                self._paused = not self._paused
            assert self._wish is not None  # while an episode is played
            wish = self._wish.after(key, env.variation, len(env.task_definition.spec.variations))
            if wish is not None:
                raise _OtherEpisode(wish)

    def _next_key(self) -> int | None:
        try:
            return self._keys.get_nowait()
        except Empty:
            return None

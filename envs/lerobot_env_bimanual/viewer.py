"""MuJoCo's interactive viewer: episodes played in real time before somebody who may ask for others."""

from __future__ import annotations

import copy
import os
import threading
import time
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, closing, contextmanager
from dataclasses import dataclass, replace
from enum import IntEnum
from queue import Empty, SimpleQueue
from typing import Any, Protocol

from lerobot_bimanual.errors import PlacementFailure
from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.experts.runner import Player, run_episode
from lerobot_env_bimanual.gl import mujoco
from lerobot_env_bimanual.world.appearance import applied
from lerobot_env_bimanual.world.servo_commands import TICK_S


class Key(IntEnum):
    """Codes of GLFW."""

    SPACE = 32
    BACKSPACE = 259
    RIGHT = 262
    LEFT = 263
    DOWN = 264
    UP = 265
    PAGE_UP = 266
    PAGE_DOWN = 267
    END = 269


KEYS = """\
right/left: seed   up/down: variation   space: pause   backspace: again
page down/up: perturbation   end: its next level"""
PATIENCE_S = 0.05
"""Between two looks at the keys while nothing moves."""


FIRST_VIEW = {"lookat": (0.2, 0.0, 0.9), "distance": 2.0, "azimuth": 180.0, "elevation": -30.0}
"""Where the viewer looks from at first, in m and degrees: roughly the front camera's place, a little higher."""


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

    def lock(self) -> AbstractContextManager[None]:
        """Nobody looks at the state while a `with` block runs."""
        ...

    def set_texts(self, texts: tuple[None, None, str, str]) -> None:
        """Write into a corner: font, place, left column, right column."""
        ...


type OpenWindow = Callable[..., AbstractContextManager[Window]]
"""Opens a window on a model and its data, with `key_callback`, which is told the code of every key."""
type Levels = tuple[str, ...]
"""The levels of one perturbation, each as the environment's option says it."""


@dataclass(frozen=True)
class Wish:
    """Which episode to play.

    Attributes:
        seed: of the reset.
        variation: index; None leaves it to the environment's options.
        perturb: what is different from the world as it is, as the environment's option says it.
    """

    seed: int
    variation: int | None = None
    perturb: str = ""

    def after(self, key: int, shown: int, variations: int, perturbations: Sequence[Levels]) -> Wish | None:
        """The episode that a key asks for; None if the key asks for none.

        Args:
            key: code of GLFW.
            shown: variation of the present episode.
            variations: how many the task has.
            perturbations: what there is to choose from; the present one is among them.
        """
        step = 1 if key in (Key.RIGHT, Key.UP, Key.PAGE_DOWN, Key.END) else -1
        match key:
            case Key.RIGHT | Key.LEFT:
                return replace(self, seed=max(0, self.seed + step))
            case Key.DOWN | Key.UP:
                return replace(self, variation=(shown + step) % variations)
            case Key.PAGE_DOWN | Key.PAGE_UP:
                here = next(place for place, levels in enumerate(perturbations) if self.perturb in levels)
                return replace(self, perturb=perturbations[(here + step) % len(perturbations)][0])
            case Key.END:
                levels = next(levels for levels in perturbations if self.perturb in levels)
                return replace(self, perturb=levels[(levels.index(self.perturb) + step) % len(levels)])
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


@contextmanager
def mujoco_window(
    model: mujoco.MjModel, data: mujoco.MjData, key_callback: Callable[[int], None] | None = None
) -> Iterator[Window]:
    """MuJoCo's own, which runs in a thread beside ours; that thread ends with the `with` block."""
    from mujoco import viewer

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


class Performance:
    """Plays episodes in a window until it is closed.

    Every perturbation is a world of its own, which may be built otherwise, so each has its own window.

    Args:
        make_env: makes the environment of a perturbation.
        player: who plays.
        name: of the player, as it is shown.
        wish: the first episode.
        perturbations: what the keys can choose; the first episode's is among them.
        open_window: MuJoCo's viewer, or what stands for it.
        sleep: waits for some seconds.
    """

    def __init__(
        self,
        make_env: Callable[[str], BimanualEnv],
        player: Player,
        name: str,
        wish: Wish,
        perturbations: Sequence[Levels],
        open_window: OpenWindow,
        sleep: Callable[[float], None] = time.sleep,
    ):
        self._make_env, self._player, self._name = make_env, player, name
        self._wish: Wish | None = wish
        self._perturbations = perturbations
        self._open_window, self._sleep = open_window, sleep
        self._view: dict[str, Any] = dict(FIRST_VIEW)
        self._paused = False
        self._due_s = 0.0

    def run(self) -> None:
        """Play until a window is closed.

        Raises:
            InvalidChoice: the first perturbation finds nothing to change in the task.
        """
        while self._wish is not None:
            with closing(self._make_env(self._wish.perturb)) as self._env:
                self._perform(self._wish.perturb)

    def _perform(self, perturb: str) -> None:
        """Play in one window until it is closed or somebody wishes another perturbation."""
        scene = self._env.scene
        self._keys: SimpleQueue[int] = SimpleQueue()
        with self._open_window(scene.model, scene.data, key_callback=self._keys.put) as self._window:
            camera = self._window.cam
            camera.lookat[:] = self._view["lookat"]
            for name in ("distance", "azimuth", "elevation"):
                setattr(camera, name, self._view[name])
            while self._wish is not None and self._wish.perturb == perturb:
                try:
                    verdict = self._play(self._wish)
                    while True:  # the last state stays until somebody asks for another episode
                        self._show(verdict)
                        self._sleep(PATIENCE_S)
                except _OtherEpisode as other:
                    self._wish = other.wish
            self._view = {name: copy.copy(getattr(camera, name)) for name in self._view}

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
        env, window, scene = self._env, self._window, self._env.scene
        if not window.is_running():
            raise _OtherEpisode(None)
        world = f"with {env.options.perturb}" if env.options.perturb else "the world as it is"
        episode = f"{self._name}, seed {env.progress.seed}, variation {env.variation}, {world}"
        window.set_texts((None, None, f"{env.task_description}\n{episode}\n{state}\n{KEYS}", ""))
        with applied(scene.model, scene.data, scene.appearance.fields):
            window.sync()
        while (key := self._next_key()) is not None:
            if key == Key.SPACE:
                self._paused = not self._paused
            assert self._wish is not None  # while an episode is played
            variations = len(env.task_definition.spec.variations)
            wish = self._wish.after(key, env.variation, variations, self._perturbations)
            if wish is not None:
                raise _OtherEpisode(wish)

    def _next_key(self) -> int | None:
        try:
            return self._keys.get_nowait()
        except Empty:
            return None

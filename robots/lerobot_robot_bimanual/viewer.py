"""MuJoCo's interactive viewer beside the simulation."""

from __future__ import annotations

import atexit
import os
from contextlib import ExitStack

from lerobot_bimanual.errors import BimanualError
from lerobot_env_bimanual.gl import mujoco
from lerobot_env_bimanual.viewer import mujoco_window
from lerobot_env_bimanual.world.appearance import applied
from lerobot_env_bimanual.world.scene import Scene


class NoDisplay(BimanualError):
    """A window was requested where there is no display."""

    def __init__(self) -> None:
        super().__init__(
            "--robot.viewer=true opens a window, but there is no display: leave it out and record videos with "
            "--robot.video_dir=FOLDER, or use a session with DISPLAY or WAYLAND_DISPLAY set"
        )


class Viewer:
    """A window that shows a copy of the scene, so that a mouse in it changes nothing in the simulation.

    Args:
        scene: the scene.

    Raises:
        NoDisplay: there is no display.
    """

    def __init__(self, scene: Scene):
        if not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
            raise NoDisplay
        self._scene = scene
        self._shown = mujoco.MjData(scene.model)
        self._closing = ExitStack()
        self._window = self._closing.enter_context(mujoco_window(scene.model, self._shown))
        atexit.register(self.close)
        self.show()

    def show(self) -> None:
        """Show the scene's present state; nothing happens after the window was closed."""
        if self._window.is_running():
            scene = self._scene
            with self._window.lock():
                mujoco.mj_copyData(self._shown, scene.model, scene.data)
            with applied(scene.model, self._shown, scene.appearance.fields):
                self._window.sync()

    def close(self) -> None:
        """Close the window."""
        atexit.unregister(self.close)
        self._closing.close()

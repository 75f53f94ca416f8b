"""Read a gamepad whose left half controls the left hand and whose right half controls the right one."""

from __future__ import annotations

import os
from dataclasses import dataclass
from importlib import import_module
from typing import Any

from lerobot_bimanual.arms import ARMS, Arm
from lerobot_bimanual.errors import BimanualError

FULL = 32767
"""Value of an axis at its end."""
PRESSED = 0.5
"""Share of a trigger's travel from which it counts as held."""

AXES = {Arm.LEFT: ("LEFTX", "LEFTY", "TRIGGERLEFT"), Arm.RIGHT: ("RIGHTX", "RIGHTY", "TRIGGERRIGHT")}
BUTTONS = {Arm.LEFT: ("LEFTSHOULDER", "LEFTSTICK"), Arm.RIGHT: ("RIGHTSHOULDER", "RIGHTSTICK")}


class NoGamepad(BimanualError):
    """No gamepad is connected, or pygame is not installed."""


@dataclass(frozen=True)
class HalfState:
    """State of one half of a gamepad.

    Attributes:
        right: deflection of the stick, -1 (left) to 1.
        up: deflection of the stick, -1 (down) to 1.
        shoulder: whether the shoulder button is held.
        trigger: whether the trigger is held.
        stick: whether the stick is pressed in.
    """

    right: float = 0.0
    up: float = 0.0
    shoulder: bool = False
    trigger: bool = False
    stick: bool = False


class Gamepad:
    """The first gamepad that SDL knows, read through pygame; SDL's names of sticks and buttons are the same for all makes.

    Raises:
        NoGamepad: pygame is not installed, or no gamepad is connected.
    """

    def __init__(self) -> None:
        os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")
        # Without a window of ours, gamepads are in the background.
        os.environ.setdefault("SDL_JOYSTICK_ALLOW_BACKGROUND_EVENTS", "1")
        try:
            self._pygame: Any = import_module("pygame")
            self._sdl: Any = import_module("pygame._sdl2.controller")
        except ModuleNotFoundError as error:
            raise NoGamepad(
                f"bimanual_gamepad reads gamepads through pygame, but there is no module {error.name!r}: "
                "pip install 'lerobot_robot_bimanual[gamepad]'"
            ) from error
        self._sdl.init()
        known = [index for index in range(self._sdl.get_count()) if self._sdl.is_controller(index)]
        if not known:
            self._sdl.quit()
            raise NoGamepad(
                "no gamepad found: connect one before the command starts, and see that /dev/input can be read "
                "(a container needs --device=/dev/input); --teleop.type=bimanual_keyboard needs a terminal only"
            )
        self._pad = self._sdl.Controller(known[0])

    @property
    def name(self) -> str:
        """Name of the make."""
        return self._pad.name

    def read(self) -> tuple[dict[Arm, HalfState], bool]:
        """Present state of both halves, by hand, and whether the start button is pressed.

        Raises:
            NoGamepad: the gamepad has been disconnected.
        """
        self._sdl.update()
        if not self._pad.attached():
            raise NoGamepad("the gamepad has been disconnected: connect it and start the command again")
        return {arm: self._half(arm) for arm in ARMS}, self._is_pressed("START")

    def stop(self) -> None:
        """Release the gamepad; it may be opened again."""
        self._pad.quit()
        self._sdl.quit()

    def _half(self, arm: Arm) -> HalfState:
        right, down, trigger = (self._axis(name) for name in AXES[arm])
        shoulder, stick = (self._is_pressed(name) for name in BUTTONS[arm])
        return HalfState(right, -down, shoulder, trigger > PRESSED, stick)

    def _axis(self, name: str) -> float:
        return max(-1.0, self._pad.get_axis(getattr(self._pygame, f"CONTROLLER_AXIS_{name}")) / FULL)

    def _is_pressed(self, name: str) -> bool:
        return bool(self._pad.get_button(getattr(self._pygame, f"CONTROLLER_BUTTON_{name}")))

"""Read keys of a terminal that LeRobot's own controls read, too."""

from __future__ import annotations

import contextlib
import os
import pty
import sys
from collections.abc import Collection
from queue import Empty, SimpleQueue
from typing import TextIO

from lerobot.utils.keyboard_input import TerminalKeyListener

from lerobot_bimanual.errors import BimanualError

WRITTEN = {"up": "\x1b[A", "down": "\x1b[B", "right": "\x1b[C", "left": "\x1b[D", "esc": "\x1b"} | {
    "enter": "\n",
    "tab": "\t",
    "space": " ",
    "backspace": "\x7f",
}
"""Characters that a terminal sends for the keys that LeRobot names."""


class NoTerminal(BimanualError):
    """Standard input is not a terminal, so there are no keys to read."""

    def __init__(self) -> None:
        super().__init__(
            "bimanual_keyboard reads keys from the terminal, but standard input is not a terminal: start the command "
            "without a pipe or a redirection"
        )


class TerminalKeys:
    """Keys by name, in the order in which they were struck.

    `lerobot-record` reads the terminal as well (next, re-record, quit), and a terminal gives each key only once. So while
    these keys are read, standard input is a pseudo terminal that all other keys are passed to.

    Args:
        names: the keys that are kept.

    Raises:
        NoTerminal: standard input is not a terminal.
    """

    def __init__(self, names: Collection[str]):
        if not sys.stdin.isatty():
            raise NoTerminal
        self._names = names
        self._struck: SimpleQueue[str] = SimpleQueue()
        self._terminal: TextIO = sys.stdin
        self._listener = TerminalKeyListener(self._sort)
        self._listener.start()  # keeps the descriptor of the terminal
        self._others, substitute = pty.openpty()
        os.set_blocking(self._others, False)
        # It stays open: LeRobot's listener still reads it after `stop`.
        sys.stdin = os.fdopen(substitute, closefd=False)

    def struck(self) -> list[str]:
        """The keys since the last call."""
        keys = []
        with contextlib.suppress(Empty):
            while True:
                keys.append(self._struck.get_nowait())
        return keys

    def stop(self) -> None:
        """Give the terminal back."""
        sys.stdin = self._terminal
        self._listener.stop()

    def _sort(self, key: str) -> None:
        if key in self._names:
            self._struck.put(key)
        else:
            with contextlib.suppress(BlockingIOError):  # no listener reads them
                os.write(self._others, WRITTEN.get(key, key).encode())

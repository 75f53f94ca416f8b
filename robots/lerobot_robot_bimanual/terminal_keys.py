"""Keys struck in a terminal, shared with LeRobot's own controls."""

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
"""What a terminal sends for the keys that LeRobot calls by a name."""


class NoTerminal(BimanualError):
    """Standard input is no terminal, so there are no keys to read."""

    def __init__(self) -> None:
        super().__init__(
            "bimanual_keyboard reads keys from the terminal, but standard input is none: start the command in a "
            "terminal, without a pipe or a redirection"
        )


class TerminalKeys:
    """Keys by name, in the order in which they were struck.

    `lerobot-record` listens to the terminal as well (next, re-record, quit), and a terminal gives each key only once. So
    while these keys are read, standard input is a terminal of our own, to which all other keys are passed on.

    Args:
        names: the keys that are kept.

    Raises:
        NoTerminal: standard input is none.
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
        # It stays open for good: LeRobot's listener still reads it when we are gone.
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
            with contextlib.suppress(BlockingIOError):  # nobody reads them
                os.write(self._others, WRITTEN.get(key, key).encode())

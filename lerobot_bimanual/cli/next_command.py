"""The last line of a command: which command comes next."""

import shlex
import sys


def show_next(*words: object) -> None:
    """Print the command that continues the work, as a line that can be copied.

    It goes to stderr, because programs may read what a command prints.

    Args:
        words: the command's words, the program's name included; empty words are left out.
    """
    print(f"next: {shlex.join(str(word) for word in words if str(word))}", file=sys.stderr)

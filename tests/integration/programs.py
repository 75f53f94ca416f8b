"""Programs of this environment, started as a user would start them, but forked where LeRobot is imported already.

Importing LeRobot takes ten seconds, which is most of the time of a small program. A server imports it once and forks
itself for every program; what differs from a fresh process is said by `run`.
"""

import atexit
import functools
import json
import os
import random
import runpy
import subprocess
import sys
import tempfile
from pathlib import Path

BIN = Path(sys.executable).parent


def run(*words: str, folder: Path, fails: bool = False, fresh: bool = False, **variables: str) -> str:
    """Run a program in a folder, offline and on one thread, and return what it prints.

    Args:
        words: the program, looked for beside this interpreter first, and its arguments.
        folder: its working directory.
        fails: whether it is meant to fail.
        fresh: start a new process. Otherwise a Python program is forked from a process that has imported LeRobot, but
            none of ours; the seed of its hashes is then that of the other programs.
        variables: more variables of its environment.
    """
    environment = os.environ | {"PATH": f"{BIN}:{os.environ['PATH']}"} | variables
    is_script = words[0] in ("python", sys.executable)
    script = Path(words[1]) if is_script else BIN / words[0]
    if fresh or not (script.suffix == ".py" or (script.parent == BIN and script.is_file())):
        child = subprocess.run(words, cwd=folder, env=environment, capture_output=True, text=True)
        code, printed, said = child.returncode, child.stdout, child.stderr
    else:
        code, printed, said = forked(script, *words[1 + is_script :], folder=folder, environment=environment)
    assert bool(code) == fails, printed[-2000:] + said[-4000:]
    return printed + said


def call(words: list[str]) -> int:
    """Exit code of a program, as a chain of commands asks for it."""
    return forked(BIN / words[0], *words[1:], folder=Path.cwd(), environment=dict(os.environ))[0]


def forked(script: Path, *arguments: str, folder: Path, environment: dict[str, str]) -> tuple[int, str, str]:
    """Exit code, standard output and error of a Python script that the server runs."""
    with tempfile.TemporaryDirectory() as place:
        streams = [Path(place, name) for name in ("out", "err")]
        request = ([str(script), *arguments], str(folder), environment, [*map(str, streams)])
        pipe = server()
        assert pipe.stdin is not None
        assert pipe.stdout is not None
        print(json.dumps(request), file=pipe.stdin, flush=True)
        code = int(pipe.stdout.readline())
        return code, *(stream.read_text(errors="replace") for stream in streams)


@functools.cache
def server() -> subprocess.Popen[str]:
    """The server of this test process, which ends with it."""
    pipe = subprocess.Popen(
        [sys.executable, __file__], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    atexit.register(pipe.communicate)
    return pipe


def serve() -> None:
    """Run the program of every line of standard input in a fork, and print its exit code."""
    import lerobot.scripts.lerobot_eval
    import lerobot.scripts.lerobot_train  # noqa: F401
    import numpy as np

    for line in sys.stdin:
        words, folder, environment, streams = json.loads(line)
        if pid := os.fork():
            sys.stdout.write(f"{os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])}\n")
            sys.stdout.flush()
            continue
        os.chdir(folder)
        os.environ.clear()
        os.environ.update(environment)
        for number, path in zip((0, 1, 2), ("/dev/null", *streams), strict=True):
            os.dup2(os.open(path, os.O_RDWR | os.O_CREAT), number)
        sys.argv, sys.path[0] = words, str(Path(words[0]).parent)
        sys.path[1:1] = filter(None, environment.get("PYTHONPATH", "").split(":"))
        random.seed()
        np.random.seed()  # noqa: NPY002  the generator that programs without a seed of their own draw from
        runpy.run_path(words[0], run_name="__main__")
        return


if __name__ == "__main__":
    serve()

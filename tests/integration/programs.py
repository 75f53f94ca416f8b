"""Programs of this environment, started as a user would start them."""

import os
import subprocess
import sys
from pathlib import Path


def run(*words: str, folder: Path, fails: bool = False, **variables: str) -> str:
    """What a program prints, in a folder, offline and on one thread.

    Args:
        words: the program, looked for beside this interpreter first, and its arguments.
        folder: its working directory.
        fails: whether it is meant to fail.
        variables: more variables of its environment.
    """
    path = f"{Path(sys.executable).parent}:{os.environ['PATH']}"
    environment = os.environ | {"PATH": path, "HF_HUB_OFFLINE": "1", "OMP_NUM_THREADS": "1"} | variables
    child = subprocess.run(words, cwd=folder, env=environment, capture_output=True, text=True, check=False)
    assert bool(child.returncode) == fails, child.stdout[-2000:] + child.stderr[-4000:]
    return child.stdout + child.stderr

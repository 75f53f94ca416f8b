"""`lerobot-bimanual-train` prints before it imports LeRobot, and keeps the memory that it frees."""

import platform
import subprocess
import sys

import pytest

FAULTS = """
import resource, sys
from lerobot_policy_bimanual.training.program import keep_freed_memory
if sys.argv[1] == "keep":
    keep_freed_memory()
import torch
def step():
    maps = [torch.zeros(64 * 2**20 // 4) for _ in range(4)]
for _ in range(4):
    step()
before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
for _ in range(5):
    step()
print(resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before)
"""


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="concerns glibc's allocator")
def test_kept_memory_is_not_asked_for_again():
    def faults(mode: str) -> int:
        command = [sys.executable, "-c", FAULTS, mode]
        return int(subprocess.run(command, check=True, capture_output=True, text=True).stdout)

    assert faults("keep") < faults("give back") / 5

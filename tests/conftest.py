"""Set-up of every test process: one thread per library, off-screen, no network, one width, interrupts, fixed seeds."""

import os
import signal
import sys

for _variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_variable, "1")
if not ("DISPLAY" in os.environ or "WAYLAND_DISPLAY" in os.environ):
    os.environ.setdefault("MUJOCO_GL", "egl")  # before any test module imports mujoco
os.environ["HF_HUB_OFFLINE"] = "1"
os.environ["WANDB_MODE"] = "disabled"
os.environ["COLUMNS"] = "160"  # tables fold alike whatever terminal runs the tests

# A shell ignores SIGINT for programs in the background, and nohup SIGHUP.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)
if signal.getsignal(signal.SIGHUP) is signal.SIG_IGN:
    signal.signal(signal.SIGHUP, signal.SIG_DFL)

import pytest  # noqa: E402
from hypothesis import HealthCheck, settings  # noqa: E402

_FUZZ_EXAMPLES = os.environ.get("FUZZ_EXAMPLES")
# A test run draws the same few examples each time; `make fuzz` draws thousands of new ones.
settings.register_profile(
    "fuzz",
    max_examples=int(_FUZZ_EXAMPLES or 15),
    derandomize=_FUZZ_EXAMPLES is None,
    database=None,
    deadline=None,
    suppress_health_check=list(HealthCheck),
)
settings.load_profile("fuzz")


@pytest.fixture(autouse=True)
def _seeded() -> None:
    """Seed torch where a test file uses it, so that initial weights do not depend on the order of tests."""
    if "torch" in sys.modules:
        sys.modules["torch"].manual_seed(0)


LONG_FILES = ("documented_commands", "lerobot_train", "examples", "results", "benchmark")
"""Slow files of minutes each. They run first, so that no worker starts one when the others have finished."""


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Begin with the longest files; skip tests marked `gpu` where there is no CUDA device."""
    items.sort(key=lambda item: item.path.stem.removeprefix("test_") not in LONG_FILES)
    gpu_items = [item for item in items if item.get_closest_marker("gpu")]
    if not gpu_items:
        return
    import torch

    if not torch.cuda.is_available():
        for item in gpu_items:
            item.add_marker(pytest.mark.skip(reason="no CUDA device"))

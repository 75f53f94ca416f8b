"""Keep geometry, softmax and losses in full precision under autocast and TF32."""

from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from threading import Lock

import torch
from torch import Tensor


def at_least_float32(x: Tensor) -> Tensor:
    """Convert bfloat16 to float32; float64 stays, so that exactness can be tested."""
    return x.to(torch.promote_types(x.dtype, torch.float32))


@contextmanager
def full_precision(device: torch.device) -> Iterator[None]:
    """Compute in float32 on a device, under autocast and TF32.

    LeRobot may train under autocast, and its programs enable a GPU's TF32: world coordinates would be off by centimetres
    in bfloat16, and by half a millimetre per metre in TF32.
    """
    without_tf32 = _WITHOUT_TF32 if device.type == "cuda" else nullcontext()
    with torch.autocast(device.type, enabled=False), without_tf32:
        yield


class _WithoutTF32:
    """Disables TF32 while any thread is inside: the setting is the process's, and threads of an evaluation share it."""

    def __init__(self):
        self._lock, self._inside, self._was_on = Lock(), 0, False

    def __enter__(self):
        with self._lock:
            if self._inside == 0 and (was_on := _is_tf32_enabled()):
                torch.backends.cuda.matmul.allow_tf32, self._was_on = False, was_on
            self._inside += 1

    def __exit__(self, *exception: object):
        with self._lock:
            self._inside -= 1
            if self._inside == 0 and self._was_on:
                torch.backends.cuda.matmul.allow_tf32, self._was_on = True, False


_WITHOUT_TF32 = _WithoutTF32()


def _is_tf32_enabled() -> bool:
    """Read PyTorch's newer setting where it exists, because the older one raises after the newer one was used."""
    matmul = torch.backends.cuda.matmul
    if hasattr(matmul, "fp32_precision"):
        return matmul.fp32_precision == "tf32"
    return bool(matmul.allow_tf32)

"""Where half precision ends."""

import torch
from torch import Tensor


def at_least_float32(x: Tensor) -> Tensor:
    """Leave autocast's bfloat16; float64 stays, so that exactness can be tested."""
    return x.to(torch.promote_types(x.dtype, torch.float32))

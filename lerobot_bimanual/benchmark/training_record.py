"""What a policy learned from, and on which machine."""

from dataclasses import dataclass
from os import cpu_count
from typing import Self


@dataclass(frozen=True)
class DatasetRecord:
    """What the policy learned from.

    Attributes:
        command: command line that makes the dataset again, with every option.
        image_size: side of its images in pixels.
        seeds: seed of each demonstration of the task that is scored, in the split `train`.
        versions: package -> version with which it was made.
    """

    command: str
    image_size: int
    seeds: tuple[int, ...]
    versions: dict[str, str]


@dataclass(frozen=True)
class Machine:
    """Where the policy was trained."""

    cpus: int
    gpu: str | None

    @classmethod
    def this(cls) -> Self:
        """The machine at hand, with its first GPU."""
        import torch

        gpu = torch.cuda.get_device_name(0) if torch.cuda.is_available() else None
        return cls(cpu_count() or 1, gpu)

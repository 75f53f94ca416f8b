"""PerAct2 against its written-out formulation: CPU time and peak memory, in one run.

The written-out formulation (tests/policies/written_out.py) has the structure of PerAct2's reference code: every
arm decodes on its own, maps are really upsampled and concatenated. Both compute the same function of the same
weights. Each figure comes from a process of its own, one after the other, so that peak memory means something;
times are CPU times of that process. Prints a table and, as the last line, the same figures as JSON.

    python benchmarks/policies.py --voxels=50              # about one CPU minute
    python benchmarks/policies.py --voxels=100 --backward # minutes, and 10 GB for the written-out one
    python benchmarks/policies.py --small                 # a training step of the laptop recipe
"""

import argparse
import importlib.util
import json
import resource
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import torch
from rich.console import Console
from rich.table import Table

from lerobot_bimanual.cameras import CAMERA_NAMES, intrinsics_from_fovy
from lerobot_bimanual.dataset import schema
from lerobot_bimanual.geometry.workspace import VOXEL_WORKSPACE
from lerobot_policy_bimanual import PerAct2Config
from lerobot_policy_bimanual.nn.voxel_grid import voxelise
from lerobot_policy_bimanual.peract2.modeling_peract2 import PerAct2Policy

WRITTEN_OUT = Path(__file__).parents[1] / "tests" / "policies" / "written_out.py"

SMALL: dict[str, Any] = {
    "voxel_size": 25,
    "channels": 16,
    "token_dim": 64,
    "num_latents": 128,
    "latent_dim": 128,
    "depth": 2,
    "heads": 4,
    "feedforward_multiplier": 2,
    "attention_dropout": 0.0,
    "language_tokens": 8,
    "language_dim": 64,
    "translation_head": "factorised",
}


def random_batch(samples: int, size: int) -> dict[str, Any]:
    """Five cameras looking down on noise."""
    batch: dict[str, Any] = {"task": ["lift the ball"] * samples}
    for camera in CAMERA_NAMES:
        batch[schema.image_key(camera)] = torch.rand(samples, 3, size, size)
        batch[schema.depth_key(camera)] = 500 + 1500 * torch.rand(samples, 1, size, size)
    pose = torch.tensor([[0.0, -1, 0, 0.2], [-1, 0, 0, 0], [0, 0, -1, 2.0], [0, 0, 0, 1]])
    batch[schema.CAMERA_EXTRINSICS] = pose.repeat(samples, 5, 1, 1).flatten(1)
    intrinsics = torch.tensor(intrinsics_from_fovy(np.pi / 3, size, size)).float()
    batch[schema.CAMERA_INTRINSICS] = intrinsics.repeat(samples, 5, 1, 1).flatten(1)
    batch[schema.STATE] = torch.rand(samples, 16)
    batch[schema.GRIPPER_FINGERS] = 0.04 * torch.rand(samples, 4)
    batch[schema.KEYPOSE_STEP] = torch.zeros(samples, 1)
    batch[schema.NEXT_KEYPOSE] = torch.tensor([0.2, 0.1, 1, 0, 1, 0, 0, 1, 0] * 2).repeat(samples, 1)
    return batch


def network_job(variant: str, voxels: int, backward: bool, checkpointing: bool) -> Callable[[], None]:
    """One pass of the full-size network or of its written-out formulation, batch 1, without dropout."""
    config = PerAct2Config(device="cpu", voxel_size=voxels, activation_checkpointing=checkpointing)
    network = PerAct2Policy(config).network.eval()
    dtype = torch.bfloat16 if variant == "bfloat16" else torch.float32
    cloud = torch.rand(1, 3, 5 * 128**2) + torch.tensor(VOXEL_WORKSPACE.lower)[:, None]
    grid = voxelise(cloud, torch.rand_like(cloud), workspace=VOXEL_WORKSPACE, voxels=voxels)
    proprio, language = torch.rand(1, 8), torch.randn(1, config.language_tokens, config.language_dim)
    voxel = torch.full((1, 2, 3), voxels // 2)
    classes = torch.ones(1, 2, 5, dtype=torch.long)
    spec = importlib.util.spec_from_file_location("written_out", WRITTEN_OUT)
    assert spec is not None
    assert spec.loader is not None
    written_out = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(written_out)

    def written() -> torch.Tensor:
        parameters = dict(network.named_parameters())
        outputs = written_out.network(parameters, grid, proprio, language, arms=2, heads=config.heads)
        return written_out.one_hot_loss(*outputs, voxel, classes)

    def ours() -> torch.Tensor:
        with torch.autocast("cpu", dtype, enabled=dtype is not torch.float32):
            prediction = network(grid, proprio, language, voxel)
        rotation = torch.nn.functional.cross_entropy(
            prediction.rotation.flatten(0, 2), classes[0, 0, 0].repeat(6)
        )
        return prediction.translation.cross_entropy(voxel).sum() + 6 * rotation

    def job() -> None:
        with torch.set_grad_enabled(backward):
            loss = written() if variant == "written_out" else ours()
        if backward:
            loss.backward()

    return job


def small_job() -> Callable[[], None]:
    """One optimizer step of the laptop recipe: batch 8, five cameras of 128 x 128, everything included."""
    config = PerAct2Config(device="cpu", optimizer_lr=2e-3, **SMALL)
    policy = PerAct2Policy(config).train()
    preset: Any = config.get_optimizer_preset()
    optimizer = preset.build(policy.get_optim_params())
    batch = random_batch(samples=8, size=128)

    def job() -> None:
        loss, _ = policy(batch)
        optimizer.zero_grad()
        loss.backward()
        torch.nn.utils.clip_grad_norm_(policy.parameters(), config.optimizer_grad_clip_norm)
        optimizer.step()

    return job


def voxelise_job(size: int, voxels: int) -> Callable[[], None]:
    """Voxelise one sample of five cameras."""
    cloud = 1.5 * torch.rand(1, 3, 5 * size**2) + torch.tensor(VOXEL_WORKSPACE.lower)[:, None]
    colours = torch.rand_like(cloud)
    return lambda: void(voxelise(cloud, colours, workspace=VOXEL_WORKSPACE, voxels=voxels))


def void(_: object) -> None:
    """Drop a result."""


def child(options: argparse.Namespace) -> None:
    """Measure one job in this process and print it as JSON."""
    torch.set_num_threads(options.threads)
    torch.manual_seed(0)
    if options.child == "small":
        job = small_job()
    elif options.child == "voxelise":
        job = voxelise_job(256, options.voxels)
    else:
        job = network_job(options.child, options.voxels, options.backward, options.checkpointing)
    before_kb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    cpu, wall = [], []
    for _ in range(options.repeats):
        start_cpu, start_wall = time.process_time(), time.perf_counter()
        job()
        cpu.append(time.process_time() - start_cpu)
        wall.append(time.perf_counter() - start_wall)
    peak_kb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    figures = {"cpu_s": min(cpu), "wall_s": min(wall), "peak_gb": (peak_kb - before_kb) / 2**20}
    sys.stdout.write(json.dumps(figures) + "\n")


def measure(job: str, options: argparse.Namespace, repeats: int) -> dict[str, float]:
    """Run a job in a process of its own."""
    flags = [f"--voxels={options.voxels}", f"--threads={options.threads}", f"--repeats={repeats}"]
    flags += ["--backward"] if options.backward else []
    flags += ["--checkpointing"] if options.checkpointing else []
    command = [sys.executable, __file__, f"--child={job}", *flags]
    output = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    return json.loads(output.splitlines()[-1])


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--voxels", type=int, default=50, help="voxels per axis of the full-size network")
    parser.add_argument("--backward", action="store_true", help="forward and backward pass")
    parser.add_argument("--checkpointing", action="store_true", help="recompute the dense head")
    parser.add_argument(
        "--bfloat16", action="store_true", help="also under autocast; slow without AVX512-BF16"
    )
    parser.add_argument("--small", action="store_true", help="only the laptop recipe and the voxel grid")
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--repeats", type=int, default=1, help=argparse.SUPPRESS)
    parser.add_argument("--child", default="", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.child:
        child(options)
        return
    if options.small:
        figures = {"training step, small recipe": measure("small", options, 8)}
        options.voxels = 100
        figures["voxel grid 100^3 of 5 x 256 x 256 points"] = measure("voxelise", options, 8)
    else:
        jobs = ["written_out", "float32", *(["bfloat16"] if options.bfloat16 else [])]
        figures = {job: measure(job, options, 1) for job in jobs}

    table = Table("job", "CPU s", "wall s", "peak memory GB", "faster", "memory")
    baseline = figures.get("written_out")
    for job, row in figures.items():
        ratios = (
            [f"{baseline['cpu_s'] / row['cpu_s']:.2f} x", f"{row['peak_gb'] / baseline['peak_gb']:.2f} x"]
            if baseline
            else ["", ""]
        )
        table.add_row(job, f"{row['cpu_s']:.3f}", f"{row['wall_s']:.3f}", f"{row['peak_gb']:.2f}", *ratios)
    Console().print(table)
    settings = {"voxels": options.voxels, "backward": options.backward, "threads": options.threads}
    sys.stdout.write(json.dumps({**settings, "torch": torch.__version__, "figures": figures}) + "\n")


if __name__ == "__main__":
    main()

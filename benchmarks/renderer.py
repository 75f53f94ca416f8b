"""RVT's renderer and decoder against their written-out formulations.

The written-out renderer paints all points from far to near; the written-out decoder gathers the five heatmaps at
every voxel of the lattice; the written-out upsampling convolves the upsampled map. Each figure comes from a
process of its own, one after the other, so that peak memory means something; times are the least CPU time of
several calls. Prints a table and, as the last line, the same figures as JSON. How long whole policies think is said by
`policies.py --policies`.

    python benchmarks/renderer.py   # about a CPU minute
"""

import argparse
import json
import resource
import subprocess
import sys
import time
from collections.abc import Callable
from typing import Any

import torch
import torch.nn.functional as F  # noqa: N812
from rich.console import Console
from rich.table import Table

from lerobot_bimanual.geometry.workspace import VOXEL_WORKSPACE
from lerobot_policy_bimanual.rvt.heatmaps import HeatmapTranslation
from lerobot_policy_bimanual.rvt.layers import UpsampledConv2d
from lerobot_policy_bimanual.rvt.point_renderer import render_views
from lerobot_policy_bimanual.rvt.views import VIEWS, pixels_of_voxels

SIZE = 220
RADIUS = 0.012


def random_cloud(image_size: int) -> tuple[torch.Tensor, torch.Tensor]:
    """As many points as five cameras give, three quarters of them in the workspace."""
    points = 1.1 * torch.rand(1, 3, 5 * image_size**2) + torch.tensor(VOXEL_WORKSPACE.lower)[:, None]
    return points, 2 * torch.rand_like(points) - 1


def paint(points: torch.Tensor, colours: torch.Tensor) -> torch.Tensor:
    """The xyz and RGB channels of all views, each point painted over those behind it."""
    scaled = (points[0] - torch.tensor(VOXEL_WORKSPACE.lower)[:, None]) * SIZE
    inside = ((scaled >= 0) & (scaled < SIZE)).all(dim=0)
    scaled, colour = scaled[:, inside], colours[0, :, inside] / 2 + 0.5
    content = torch.cat([scaled * (2 / SIZE) - 1, colour]).T
    cell = scaled.long()
    cells, depths = torch.cat([cell, SIZE - 1 - cell]), torch.cat([scaled, SIZE - scaled])
    step = torch.arange(-1, 2)
    disc = torch.cartesian_prod(step, step)
    disc = disc[disc.pow(2).sum(1) <= (RADIUS * SIZE / 2) ** 2]
    images = torch.zeros(5, SIZE, SIZE, 6)
    for image, view in zip(images, VIEWS, strict=True):
        order = depths[view.depth].argsort(descending=True)
        rows = cells[view.row, order, None] + disc[:, 0]
        columns = cells[view.column, order, None] + disc[:, 1]
        on = (rows >= 0) & (rows < SIZE) & (columns >= 0) & (columns < SIZE)
        image[rows[on], columns[on]] = content[order][:, None].expand(-1, len(disc), -1)[on]
    return images.permute(0, 3, 1, 2)


def score_lattice(logits: torch.Tensor) -> torch.Tensor:
    """The best voxel (3,) of heatmaps (1, 1, views, v, v), from the score of every one."""
    heat = logits[0, 0].flatten(1).softmax(1).view(5, SIZE, SIZE)
    axis = torch.arange(SIZE)
    score = torch.zeros(SIZE, SIZE, SIZE)
    for x in range(SIZE):  # all of the lattice's indices at once would be a gigabyte
        voxel = torch.cartesian_prod(torch.tensor([x]), axis, axis)
        rows, columns = pixels_of_voxels(voxel, SIZE)
        score[x] = heat[torch.arange(5), rows, columns].mean(1).view(SIZE, SIZE)
    best = score.argmax()
    return torch.stack([best // SIZE**2, best // SIZE % SIZE, best % SIZE])


def make_job(name: str) -> Callable[[], object]:
    """One of the jobs of `PAIRS`, or its written-out formulation, on the paper's sizes."""
    part, _, variant = name.partition(":")
    if part == "upsample":
        layer, x = UpsampledConv2d(64, 64, 11), torch.randn(5, 64, 20, 20)

        def convolve() -> torch.Tensor:
            fine = F.interpolate(x, scale_factor=11, mode="bilinear", align_corners=False)
            return F.conv2d(F.pad(fine, (5,) * 4, mode="replicate"), layer.conv.weight, layer.conv.bias)

        return convolve if variant else lambda: layer(x)
    if part == "decode":
        logits = 4 * torch.randn(1, 1, 5, SIZE, SIZE)
        decoder = HeatmapTranslation(logits, 1.5)
        return (lambda: score_lattice(logits)) if variant else (lambda: decoder.candidates().best())
    cloud = random_cloud(int(part.removeprefix("render")))
    if variant:
        return lambda: paint(*cloud)
    return lambda: render_views(*cloud, workspace=VOXEL_WORKSPACE, size=SIZE, radius=RADIUS)


PAIRS = {
    "render128": "five views of 5 x 128 x 128 points",
    "render256": "five views of 5 x 256 x 256 points",
    "decode": "best of 220^3 voxels",
    "upsample": "upsampling by 11 and 11 x 11 convolution",
}


def child(options: argparse.Namespace) -> None:
    """Measure one job in this process and print it as JSON."""
    torch.set_num_threads(options.threads)
    torch.manual_seed(0)
    job = make_job(options.child)
    before_kb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    cpu_s = []
    with torch.no_grad():
        for _ in range(options.repeats):
            start = time.process_time()
            job()
            cpu_s.append(time.process_time() - start)
    peak_kb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    sys.stdout.write(json.dumps({"cpu_s": min(cpu_s), "peak_gb": (peak_kb - before_kb) / 2**20}) + "\n")


def measure(job: str, threads: int, repeats: int) -> dict[str, float]:
    """Run a job in a process of its own."""
    flags = [f"--child={job}", f"--threads={threads}", f"--repeats={repeats}"]
    command = [sys.executable, __file__, *flags]
    output = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    return json.loads(output.splitlines()[-1])


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--repeats", type=int, default=8, help="calls per figure; written-out ones get two")
    parser.add_argument("--child", default="", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.child:
        child(options)
        return

    figures: dict[str, Any] = {"threads": options.threads, "torch": torch.__version__}
    table = Table(
        "job",
        "ours ms",
        "written out ms",
        "faster",
        "ours GB",
        "written out GB",
        title="RVT, batch 1, CPU time",
    )
    for job, title in PAIRS.items():
        ours = measure(job, options.threads, options.repeats)
        plain = measure(f"{job}:written_out", options.threads, 2)
        figures[job] = {"ours": ours, "written_out": plain}
        times = [f"{1e3 * ours['cpu_s']:.1f}", f"{1e3 * plain['cpu_s']:.0f}"]
        ratio = f"{plain['cpu_s'] / ours['cpu_s']:.1f} x"
        table.add_row(title, *times, ratio, f"{ours['peak_gb']:.2f}", f"{plain['peak_gb']:.2f}")
    Console().print(table)
    print(json.dumps(figures))


if __name__ == "__main__":
    main()

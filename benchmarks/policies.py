"""PerAct2 against its written-out formulation, stage by stage and whole: time and peak memory, in one run.

The written-out formulation (`peract/reference.py`) has the structure of PerAct2's reference code: every
arm decodes on its own, maps are really upsampled and concatenated. Both compute the same function of the same
weights. On a CPU times are CPU times and memory is resident (needs Linux); on a GPU times are taken by events,
after one call to warm up, and memory is what PyTorch allocated. Memory counts beyond what was there before the
call, so without the weights. Prints a table and, as the last line, the same figures as JSON.

    python benchmarks/policies.py                                  # the whole at 50^3, half a CPU minute
    python benchmarks/policies.py --stages --backward              # stage by stage too
    python benchmarks/policies.py --voxels=100 --backward          # minutes, and 10 GB for the written-out one
    python benchmarks/policies.py --variants float32 bfloat16 compile checkpointing --backward
    python benchmarks/policies.py --policies peract2 peract_lf     # select_action and training of whole policies
    python benchmarks/policies.py --policies peract2 --set projection_dilations=[3,9]   # beyond the small recipe
"""

import argparse
import ctypes
import gc
import json
import time
from pathlib import Path
from typing import Any

import torch
from policy_jobs import Job, Setting, network_job, policy_job, small_flags
from policy_stages import TITLES, Stages
from rich.console import Console
from rich.table import Table

VARIANTS = ("float32", "bfloat16", "compile", "checkpointing")
"""Of our network; all keep their voxel maps with the channels last in memory."""

WRITTEN_OUT_BYTES = {False: (0.5e9, 3e3), True: (3e9, 8e3)}
"""What the written-out network takes, by `--backward`: at any size, and per voxel, for one sample. A tenth to a half
more than was measured with 50 and 100 voxels."""

Figures = dict[str, float]


def measure(job: Job | None, setting: Setting, repeats: int, *, warm_up: bool = False) -> Figures | None:
    """The fastest of several calls, and the peak of their memory."""
    if job is None:
        return None
    gpu = setting.device == "cuda"
    clock, start_memory, peak_bytes = (
        (time_on_gpu, start_gpu_memory, torch.cuda.max_memory_allocated)
        if gpu
        else (time_on_cpu, start_cpu_memory, cpu_peak_bytes)
    )
    gc.collect()
    with torch.set_grad_enabled(setting.backward):
        if gpu or warm_up:
            job()
        before = start_memory()
        seconds = min(clock(job) for _ in range(repeats))
        return {"seconds": seconds, "peak_gb": (peak_bytes() - before) / 1e9}


def time_on_cpu(job: Job) -> float:
    start = time.process_time()
    job()
    return time.process_time() - start


def start_cpu_memory() -> int:
    """Bytes resident now, from which on the peak is counted anew."""
    ctypes.CDLL(None).malloc_trim(0)  # else what earlier jobs have freed would serve this one
    Path("/proc/self/clear_refs").write_text("5")
    return cpu_peak_bytes()


def cpu_peak_bytes() -> int:
    return proc_bytes("self/status", "VmHWM")


def proc_bytes(file: str, entry: str) -> int:
    lines = (Path("/proc") / file).read_text().splitlines()
    return next(int(line.split()[1]) * 1024 for line in lines if line.startswith(entry))


def time_on_gpu(job: Job) -> float:
    start, end = torch.cuda.Event(enable_timing=True), torch.cuda.Event(enable_timing=True)
    start.record()
    job()
    end.record()
    torch.cuda.synchronize()
    return start.elapsed_time(end) / 1e3


def start_gpu_memory() -> int:
    torch.cuda.synchronize()
    torch.cuda.reset_peak_memory_stats()
    return torch.cuda.memory_allocated()


def missing_memory(setting: Setting) -> str | None:
    """Why the written-out network would not fit, or None if it does."""
    fixed, per_voxel = WRITTEN_OUT_BYTES[setting.backward]
    needed = setting.batch * (fixed + per_voxel * setting.voxels**3)
    free = torch.cuda.mem_get_info()[0] if setting.device == "cuda" else proc_bytes("meminfo", "MemAvailable")
    if needed < free:
        return None
    return (
        f"The written-out network is left out: --voxels={setting.voxels} --batch={setting.batch} takes about "
        f"{needed / 1e9:.0f} GB, and {free / 1e9:.0f} GB are free. Fewer of either would fit."
    )


def row(title: str, ours: Figures | None, written: Figures | None) -> list[str]:
    def cells(figures: Figures | None) -> list[str]:
        return [f"{figures['seconds']:.3f}", f"{figures['peak_gb']:.2f}"] if figures else ["", ""]

    ratios = ["", ""]
    if ours and written:
        ratios[0] = f"{written['seconds'] / ours['seconds']:.2f} x"
        if written["peak_gb"] > 0.1:  # below, it is the allocator that is measured
            ratios[1] = f"{ours['peak_gb'] / written['peak_gb']:.2f} x"
    return [title, *cells(ours), *cells(written), *ratios]


def compare(setting: Setting, options: argparse.Namespace) -> tuple[Table, dict[str, Any]]:
    """The network, whole and by stages."""
    passes = "forward and backward" if setting.backward else "forward"
    table = Table(
        *("", "s", "GB", "written out s", "written out GB", "faster", "memory"),
        title=f"PerAct2, {setting.voxels}^3 voxels, batch {setting.batch}, {setting.device}, {passes}",
    )
    refusal = missing_memory(setting)
    if refusal:
        Console(stderr=True).print(refusal)
    figures: dict[str, Any] = {}
    for stage, title in TITLES.items() if options.stages else ():
        jobs = getattr(Stages(setting), stage)()
        ours, written = (
            measure(job, setting, options.repeats) for job in (jobs[0], None if refusal else jobs[1])
        )
        figures[stage] = {"ours": ours, "written_out": written}
        table.add_row(*row(title, ours, written))
    table.add_section()
    written = None if refusal else measure(network_job("written_out", setting), setting, 1)
    figures["written_out"] = written
    for variant in options.variants:
        job = network_job(variant, setting)
        figures[variant] = ours = measure(job, setting, 1, warm_up=variant == "compile")
        table.add_row(*row(f"whole, {variant}", ours, written))
    return table, figures


def time_policies(setting: Setting, options: argparse.Namespace) -> tuple[Table, dict[str, Any]]:
    """Latency and training of whole policies."""
    size = "default size" if options.full_size else "small recipes"
    table = Table(
        *("", "select_action s", "training samples per s", "training GB"),
        title=f"whole policies, {size}, five 128 px cameras, training batch {setting.batch}, {setting.device}",
    )
    figures: dict[str, Any] = {}
    beyond = dict(word.split("=", 1) for word in options.set)
    for policy in options.policies:
        flags = ({} if options.full_size else small_flags(policy)) | beyond
        act, train = (
            measure(policy_job(policy, flags, each), each, options.repeats)
            for each in (
                Setting(setting.voxels, 1, setting.device, backward=False),
                Setting(setting.voxels, setting.batch, setting.device, backward=True),
            )
        )
        assert act is not None
        assert train is not None
        rate = setting.batch / train["seconds"]
        name = ", ".join([policy, *options.set])
        figures[name] = {"select_action": act, "train": train, "samples_per_s": rate}
        table.add_row(name, f"{act['seconds']:.3f}", f"{rate:.2f}", f"{train['peak_gb']:.2f}")
    return table, figures


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--voxels", type=int, default=50, help="voxels per axis, a multiple of 5")
    parser.add_argument("--batch", type=int, default=1)
    parser.add_argument("--backward", action="store_true", help="forward and backward pass")
    parser.add_argument("--stages", action="store_true", help="also every stage on its own")
    parser.add_argument("--variants", nargs="*", choices=VARIANTS, default=["float32"], help="of our network")
    parser.add_argument("--policies", nargs="+", metavar="TYPE", help="whole policies instead of the network")
    parser.add_argument(
        "--set",
        nargs="+",
        metavar="NAME=VALUE",
        default=[],
        help="options of whole policies, beyond the small recipe",
    )
    parser.add_argument("--full_size", action="store_true", help="policies at their default sizes")
    devices = ("cpu", "cuda") if torch.cuda.is_available() else ("cpu",)
    parser.add_argument("--device", choices=devices, default=devices[-1])
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument(
        "--repeats", type=int, default=2, help="calls per stage or policy; the fastest counts"
    )
    options = parser.parse_args()
    torch.set_num_threads(options.threads)
    torch.manual_seed(0)
    setting = Setting(options.voxels, options.batch, options.device, options.backward)
    table, figures = (time_policies if options.policies else compare)(setting, options)
    Console(width=120).print(table)
    print(json.dumps(vars(options) | {"torch": torch.__version__, "figures": figures}))


if __name__ == "__main__":
    main()

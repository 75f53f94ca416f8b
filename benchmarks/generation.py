"""What a stored demonstration costs, stage by stage.

Records a few demonstrations as `lerobot-bimanual generate` does in one of its workers, and merges them. Prints a
table and, as the last line, the same figures as JSON. All times are CPU times of this process, so that other work
on the machine changes them little; loading LeRobot, which a run does once, is given apart.

    python benchmarks/generation.py --task=lift_ball --demos=3
"""

import argparse
import json
import logging
import os
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Literal

for _variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "HF_DATASETS_DISABLE_PROGRESS_BARS"):
    os.environ[_variable] = "1"

from rich.console import Console  # noqa: E402
from rich.table import Table  # noqa: E402

from lerobot_bimanual.episode import CONTROL_HZ, Episode  # noqa: E402
from lerobot_env_bimanual.commands.generate import GenerateConfig  # noqa: E402
from lerobot_env_bimanual.generation.settings import GenerationSettings  # noqa: E402

type Choice = Literal["frames", "keyframes", "both"]

RUNS: tuple[tuple[Choice, str], ...] = (("keyframes", "128"), ("frames", "256"), ("both", "256"))
"""View and image size of each run."""

STAGES = ("physics and planning", "rendering", "encoding and writing", "checking", "merging")


class Stopwatch:
    """CPU seconds per stage."""

    def __init__(self):
        self.seconds = dict.fromkeys(STAGES, 0.0)

    @property
    def total(self) -> float:
        """Seconds of all stages."""
        return sum(self.seconds.values())

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        """Add the time of a block; time of a stage within another one counts once."""
        others, start = self.total, time.process_time()
        yield
        self.seconds[name] += time.process_time() - start - (self.total - others)

    def rendering(self, episode: Episode) -> Episode:
        """The same episode with its images on the clock."""

        def images(row: int):
            with self.stage("rendering"):
                return episode.images(row)

        return replace(episode, images=images)


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--task", default="lift_ball")
    parser.add_argument("--demos", type=int, default=3)
    options = parser.parse_args()
    start = time.process_time()
    load_lerobot()
    loading_s = time.process_time() - start
    rows = [measure(options.task, options.demos, view, size) for view, size in RUNS]
    table = Table(title=f"{options.demos} demonstrations of {options.task}: CPU seconds per demonstration")
    for heading in ("view", "pixels", "demo", "rows", *STAGES, "total", "MB"):
        table.add_column(heading, justify="left" if heading == "view" else "right")
    for row in rows:
        table.add_row(*map(str, row.values()))
    Console(width=160).print(table)
    print(f"loading LeRobot, once per run: {loading_s:.1f} s")
    print(json.dumps({"benchmark": "generation", "loading_lerobot_s": round(loading_s, 2), "rows": rows}))


def load_lerobot() -> None:
    """Import what a worker imports, and keep it quiet and on one core."""
    import av.logging
    import pyarrow
    import torch

    import lerobot_bimanual.dataset.writer  # noqa: F401

    torch.set_num_threads(1)
    pyarrow.set_cpu_count(1)
    av.logging.set_libav_level(av.logging.ERROR)
    logging.getLogger("lerobot").setLevel(logging.CRITICAL)


def measure(task: str, demos: int, view: Choice, size: str) -> dict[str, object]:
    """Figures of one run, per demonstration."""
    from lerobot_bimanual.dataset.writer import ViewWriter, check_videos, write_episode
    from lerobot_env_bimanual.generation.candidates import ShardReport, next_round
    from lerobot_env_bimanual.generation.merging import merge_shards
    from lerobot_env_bimanual.generation.shards import make_recorder

    watch = Stopwatch()
    with tempfile.TemporaryDirectory() as folder:
        root = Path(folder)
        config = GenerateConfig(
            task=task, episodes=demos, view=view, image_size=size, episodes_per_shard=demos, root=root
        )
        settings = GenerationSettings.parse(config)
        recorder = make_recorder(settings, task)
        recorder.record(config.first_seed, 0)  # compiles the world; a worker keeps it for all its shards
        (shard,) = next_round(settings, [], 0)
        writers = [
            ViewWriter(
                root / "shard" / name, "local/x", name, settings.cameras, settings.height, settings.width
            )
            for name in settings.views
        ]
        ticks, rows, recorded = 0, 0, []
        for candidate in shard.candidates:
            with watch.stage("physics and planning"):
                _, episode = recorder.record(candidate.seed, candidate.variation)
            if episode is None:
                continue
            with watch.stage("encoding and writing"):
                write_episode(watch.rendering(episode), writers)
            ticks += len(episode.steps)
            rows += sum(len(writer.rows(episode)) for writer in writers)
            recorded.append(candidate)
        for writer in writers:
            with watch.stage("encoding and writing"):
                writer.finish()
        with watch.stage("checking"):
            for writer in writers:
                check_videos(writer.root)
        with watch.stage("merging"):
            shards = [(root / "shard", ShardReport(tuple(recorded), ()))]
            merge_shards(settings, "", shards, root / "merged", root / "cache")
        size_mb = sum(path.stat().st_size for path in (root / "merged").rglob("*") if path.is_file()) / 1e6
        recorder.close()
    # `finish` has checked the videos already: count that once.
    watch.seconds["encoding and writing"] -= watch.seconds["checking"]
    per_demo = {stage: round(watch.seconds[stage] / len(recorded), 2) for stage in STAGES}
    return {
        "view": view,
        "pixels": size,
        "demo": f"{ticks / CONTROL_HZ / len(recorded):.1f} s",
        "rows": round(rows / len(recorded)),
        **per_demo,
        "total": round(watch.total / len(recorded), 2),
        "MB": round(size_mb / len(recorded), 2),
    }


if __name__ == "__main__":
    main()

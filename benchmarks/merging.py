"""CPU time of merging shards, ours beside LeRobot's `aggregate_datasets`, in one process.

Usage: .venv/bin/python benchmarks/merging.py [--shards=6]
"""

import argparse
import contextlib
import io
import json
import tempfile
import time
from pathlib import Path

from lerobot.datasets.aggregate import aggregate_datasets

from lerobot_bimanual.dataset.merging import merge_datasets
from lerobot_bimanual.dataset.schema import VIEWS
from lerobot_env_bimanual.commands.dataset_generate import DatasetGenerateConfig, settings_of
from lerobot_env_bimanual.generation.plan import next_round
from lerobot_env_bimanual.generation.shard import ShardRecorder

REPO_ID = "local/shards"


def main() -> None:
    """Record shards of one short episode each, merge them in both ways, print seconds per shard, and as JSON at last."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--shards", type=int, default=6)
    count = parser.parse_args().shards
    with tempfile.TemporaryDirectory() as folder, contextlib.redirect_stderr(io.StringIO()):
        root = Path(folder)
        config = DatasetGenerateConfig(
            task="lift_ball",
            episodes=count,
            episodes_per_shard=1,
            image_size="128",
            root=root,
            repo_id=REPO_ID,
        )
        settings = settings_of(config)
        recorder, recording = ShardRecorder(), time.process_time()
        shards = next_round(settings, [], 0)
        for shard in shards:
            recorder.record(settings, shard, root / shard.name, lambda: None)
        recorder.close()
        figures = {"recording_s": (time.process_time() - recording) / count}
        print(f"recording one shard, both views: {figures['recording_s']:.2f} s")
        for view in VIEWS:
            parts = [root / shard.name / view for shard in shards]
            start = time.process_time()
            aggregate_datasets(
                [REPO_ID] * count,
                REPO_ID,
                roots=parts,
                aggr_root=root / f"theirs_{view}",
                concatenate_videos=False,
                concatenate_data=False,
            )
            middle = time.process_time()
            merge_datasets(parts, root / f"ours_{view}")
            theirs, ours = (middle - start) / count, (time.process_time() - middle) / count
            print(f"{view}: LeRobot {theirs:.2f} s, ours {ours:.3f} s per shard, ratio {ours / theirs:.3f}")
            figures |= {f"{view}_theirs_s": theirs, f"{view}_ours_s": ours}
        print(json.dumps({"shards": count} | figures))


if __name__ == "__main__":
    main()

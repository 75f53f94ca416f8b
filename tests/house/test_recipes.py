"""The recipes beside the policies: stock training reads them, and a benchmark trains what they say."""

from pathlib import Path

import pytest
from documents import parse

from lerobot_bimanual.benchmark.config import BenchmarkConfig
from lerobot_bimanual.benchmark.plan import Plan
from lerobot_bimanual.benchmark.recipes import PROTOCOLS

PACKAGES = Path(__file__).parents[2] / "policies" / "lerobot_policy_bimanual"
FILES = sorted(PACKAGES.glob("*/recipes/*.yaml"))


def test_every_policy_has_a_recipe_of_every_size():
    policies = {
        path.parent.name.removeprefix("configuration_") for path in PACKAGES.glob("*/configuration_*.py")
    }
    assert {(path.parts[-3], path.stem) for path in FILES} == {
        (policy, size) for policy in policies | {"act"} for size in PROTOCOLS
    }


@pytest.mark.parametrize("path", FILES, ids=lambda path: f"{path.parts[-3]}-{path.stem}")
def test_stock_training_reads_a_recipe_and_a_benchmark_trains_it(path: Path):
    from lerobot.configs.train import TrainPipelineConfig

    planned = parse(*Plan.of(BenchmarkConfig(policy=path.parts[-3], recipe=path.stem)).training().words)
    read = TrainPipelineConfig.from_pretrained(path, cli_args=[])
    for name in ("policy", "steps", "batch_size", "save_freq"):
        assert getattr(planned, name) == getattr(read, name)
    read.validate()

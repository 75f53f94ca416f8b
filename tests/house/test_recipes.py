"""The recipes beside the policies: stock training reads them, and a benchmark trains what they say."""

from pathlib import Path

import pytest

from lerobot_bimanual.benchmark.config import BenchmarkConfig
from lerobot_bimanual.benchmark.plan import Plan
from lerobot_bimanual.benchmark.recipes import PROTOCOLS

PACKAGES = Path(__file__).parents[2] / "policies" / "lerobot_policy_bimanual"
FILES = sorted(PACKAGES.glob("*/recipes/*.yaml"))


def settings(source: Path | list[str]):
    """What `lerobot-train` makes of a config file, or of flags."""
    import draccus
    import lerobot.policies.factory  # noqa: F401  registers LeRobot's own policies
    from lerobot.configs.train import TrainPipelineConfig

    import lerobot_policy_bimanual.configurations  # noqa: F401  registers ours

    if isinstance(source, Path):
        return TrainPipelineConfig.from_pretrained(source, cli_args=[])
    return draccus.parse(TrainPipelineConfig, args=source, exit_on_error=False)


def test_every_policy_has_a_recipe_of_every_size():
    policies = {
        path.parent.name.removeprefix("configuration_") for path in PACKAGES.glob("*/configuration_*.py")
    }
    assert {(path.parts[-3], path.stem) for path in FILES} == {
        (policy, size) for policy in policies | {"act"} for size in PROTOCOLS
    }


@pytest.mark.parametrize("path", FILES, ids=lambda path: f"{path.parts[-3]}-{path.stem}")
def test_stock_training_reads_a_recipe_and_a_benchmark_trains_it(path: Path):
    read = settings(path)
    plan = Plan.of(BenchmarkConfig(policy=path.parts[-3], recipe=path.stem))
    planned = settings(plan.training().words[1:])
    assert planned.policy == read.policy
    assert (planned.steps, planned.batch_size, planned.save_freq) == (
        read.steps,
        read.batch_size,
        read.save_freq,
    )
    read.validate()

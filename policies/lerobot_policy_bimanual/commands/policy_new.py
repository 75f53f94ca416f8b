"""The command `policy new`."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path


@dataclass
class PolicyNewConfig:
    """Flags of the command `policy new`."""

    name: str = field(kw_only=True)  # type of the policy, as in --policy.type=my_policy
    output: Path | None = None  # new folder; by default lerobot_policy_NAME, here


def policy_new(config: PolicyNewConfig) -> None:
    """Write a distribution with a policy of your own, which works as it is.

    Its network predicts the next keypose from where the hands are. Config, network and processors are in the files where
    LeRobot looks for them, a recipe is there for `policy benchmark`, and a test overfits a batch.

    Examples:
        lerobot-bimanual policy new --name=blind_mlp
    """
    from lerobot_bimanual.new_distribution import write_distribution
    from lerobot_bimanual.terminal import show_next

    folder = config.output or Path(f"lerobot_policy_{config.name}")
    write_distribution(Path(__file__).parents[1] / "new_policy", "blind_mlp", config.name, folder)
    show_next("pip", "install", "--no-build-isolation", "--no-deps", "-e", folder)

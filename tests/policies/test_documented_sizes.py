"""The table of stages in docs/policies.md is the code."""

import re
from pathlib import Path

import pytest
import torch
from torch import nn

from lerobot_policy_bimanual import PerAct2Config, PerActLFConfig
from lerobot_policy_bimanual.peract2.modeling_peract2 import PerAct2Policy
from lerobot_policy_bimanual.peract_lf.modeling_peract_lf import PerActLFPolicy

DOCUMENT = Path(__file__).parents[2] / "docs" / "policies.md"
STAGE, TOTAL, LANGUAGE = re.compile(r"`([a-z_.]+)`"), "all of the network", "language encoder"


def stages() -> dict[str, list[list[int]]]:
    """Numbers of the columns reference, two arms and one arm, by the text of the first column."""
    section = DOCUMENT.read_text().partition("## Fidelity")[2].partition("\n## ")[0]
    rows = [line.strip("| ").split(" | ") for line in section.splitlines() if line.startswith("| ")][1:]
    return {
        row[0]: [
            [int(number.replace(" ", "")) for number in re.findall(r"\d[\d ]*", cell)] for cell in row[-3:]
        ]
        for row in rows
    }


def size(module: nn.Module, prefixes: tuple[str, ...] = ("",)) -> int:
    return sum(value.numel() for name, value in module.named_parameters() if name.startswith(prefixes))


@pytest.fixture(scope="module")
def networks() -> list[tuple[nn.Module, ...]]:
    """PerAct2's network, and the leader's and the follower's."""
    with torch.device("meta"):
        both = PerAct2Policy(PerAct2Config(device="cpu", keypose_horizon=25)).network
        pair = PerActLFPolicy(PerActLFConfig(device="cpu", keypose_horizon=25)).network
    return [(both,), (pair.leader, pair.follower)]


def test_every_stage_has_the_documented_parameters_and_no_stage_is_left_out(networks):
    seen = 0
    for stage, (reference, *ours) in stages().items():
        prefixes = tuple(STAGE.findall(stage)) or (("",) if stage == TOTAL else ())
        if not prefixes:
            continue
        for documented, group in zip(ours, networks, strict=True):
            counts = [size(network, prefixes) for network in group]
            assert documented == sorted(set(counts)), stage
        assert reference == ours[0], stage
        seen += ours[0][0]
    assert seen == 2 * size(networks[0][0])  # the stages, and their total


def test_the_language_encoder_has_the_documented_parameters():
    with torch.device("meta"):
        policy = PerAct2Policy(PerAct2Config(device="cpu", keypose_horizon=25))
    assert stages()[LANGUAGE][1] == [size(policy.language)]

"""A trained policy as a player, loaded and asked as `lerobot-eval` does it."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from lerobot_bimanual.errors import BimanualError
from lerobot_env_bimanual.checkpoint import Checkpoint
from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.experts.runner import Move, Player


def policy_player(checkpoint: Path) -> Player:
    """The policy of a folder `pretrained_model`, on the device that there is.

    Args:
        checkpoint: the folder; LeRobot calls whatever its processor files name, so look first at a stranger's.

    Raises:
        BimanualError: there is no checkpoint, or LeRobot cannot load it.
    """
    Checkpoint.read(checkpoint)
    import torch
    from lerobot.configs.policies import PreTrainedConfig
    from lerobot.envs.utils import preprocess_observation
    from lerobot.policies.factory import get_policy_class, make_pre_post_processors
    from lerobot.utils.import_utils import register_third_party_plugins

    register_third_party_plugins()
    try:
        config = PreTrainedConfig.from_pretrained(checkpoint)
        policy = get_policy_class(config.type).from_pretrained(checkpoint, config=config)
        preprocess, postprocess = make_pre_post_processors(
            config,
            pretrained_path=str(checkpoint),
            preprocessor_overrides={"device_processor": {"device": config.device}},
        )
    except Exception as error:  # LeRobot lets through whatever a reader of files raises
        raise BimanualError(f"LeRobot cannot load the checkpoint at {checkpoint}: {error}") from error

    def play(env: BimanualEnv) -> Iterator[Move]:
        policy.reset()
        while True:
            arrays = preprocess_observation(_batch_of_one(env.observe()))
            observation = {**arrays, "task": [env.task_description]}
            with torch.inference_mode():
                action = postprocess(policy.select_action(preprocess(observation)))
            yield Move("predicted", action[0].to("cpu").numpy())

    return play


def _batch_of_one(observation: dict[str, Any]) -> dict[str, Any]:
    """As a vector environment gives it, every array with one more dimension."""
    return {
        key: _batch_of_one(value) if isinstance(value, dict) else np.asarray(value)[None]
        for key, value in observation.items()
    }

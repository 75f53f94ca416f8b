"""Finds out what `lerobot-eval` evaluates: reads its command line again with LeRobot's own parser.

LeRobot passes neither the policy nor the number of episodes to an environment.
"""
# No postponed annotations: LeRobot's parser reads them as types.

import base64
import hashlib
import json
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import draccus
import safetensors.torch
from lerobot.configs import PreTrainedConfig, parser
from lerobot.configs.eval import EvalPipelineConfig
from lerobot.utils.random_utils import deserialize_rng_state, serialize_rng_state

from lerobot_bimanual.cli.lerobot_flags import program_name
from lerobot_bimanual.errors import BimanualError
from lerobot_bimanual.files import sha256
from lerobot_env_bimanual.vector.evaluation import Evaluation

OURS = "lerobot-bimanual-eval"


def evaluation_of_program() -> Evaluation:
    """What this process evaluates; unknown unless the program is `lerobot-eval` or `lerobot-bimanual-eval`.

    Raises:
        BimanualError: LeRobot would record the evaluation, which does not work here, or play several tasks at once with one
            of its own policies, which has a single queue of actions.
    """
    program = program_name()
    if program not in ("lerobot-eval", OURS):
        return Evaluation()
    config = _command_line()  # pyright: ignore[reportCallIssue]  LeRobot's parser gives it
    if config.eval.recording:
        raise BimanualError(
            "--eval.recording=true does not store what this environment shows: leave it out, evaluate with "
            "--env.results_dir=FOLDER, and make a dataset with `lerobot-bimanual dataset from-results --results=FOLDER`"
        )
    if config.env.max_parallel_tasks > 1 and type(config.policy).__module__.startswith("lerobot.policies."):
        raise BimanualError(
            f"--env.max_parallel_tasks={config.env.max_parallel_tasks} plays all tasks with one policy, but "
            f"{config.policy.type} has one queue of actions, which they would share: leave it out"
        )
    if config.policy is None or config.seed is None:
        return Evaluation()
    seeds = range(config.seed, config.seed + config.eval.n_episodes)
    return replace(evaluation_of(config.policy, seeds, config.rename_map), shows_bar=program == OURS)


def evaluation_of(
    policy: PreTrainedConfig, seeds: range, rename_map: Mapping[str, str] | None = None
) -> Evaluation:
    """The evaluation of a policy, given its loaded config, on seeds; the first also seeds the policy's own randomness."""
    options = draccus.encode(policy)
    place = options.pop("pretrained_path", None)
    facts = json.dumps([options, dict(rename_map or {})], sort_keys=True, default=str)
    digest = hashlib.sha256(facts.encode())
    if place is not None and (folder := Path(place)).is_dir():
        files = sorted(path for path in folder.rglob("*") if path.is_file())
        for path in files:
            digest.update(f"{path.relative_to(folder).as_posix()} {sha256(path)}\n".encode())
    else:
        digest.update(str(place).encode())
    return Evaluation(
        policy={"type": policy.type, "sha256": digest.hexdigest(), "seed": seeds.start},
        trained_worlds=options.get("trained_worlds", {}),
        seeds=seeds,
        random_state=_random_state,
        set_random_state=_set_random_state,
    )


@parser.wrap()
def _command_line(config: EvalPipelineConfig) -> EvalPipelineConfig:
    return config


def _random_state() -> str:
    return base64.b64encode(safetensors.torch.save(serialize_rng_state())).decode()


def _set_random_state(text: str) -> None:
    deserialize_rng_state(safetensors.torch.load(base64.b64decode(text)))

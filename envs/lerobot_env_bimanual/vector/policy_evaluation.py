"""Scores a policy that is a Python object, and leaves the record that LeRobot's evaluation leaves."""

import sys
import tempfile
from collections.abc import Iterable, Sequence
from dataclasses import replace
from functools import partial
from itertools import batched
from pathlib import Path
from typing import Any

import numpy as np
from gymnasium.vector.utils import iterate
from tqdm import tqdm

from lerobot_bimanual.errors import BimanualError, InvalidChoice, check_range
from lerobot_bimanual.results.evaluation import EvaluationRecord
from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.episode.observations import dataset_row
from lerobot_env_bimanual.options import EnvOptions, checked_seed
from lerobot_env_bimanual.vector.evaluation import Evaluation, record_name, summary
from lerobot_env_bimanual.vector.gym_env import Keys, checked_keys
from lerobot_env_bimanual.vector.lazy_vector_env import LazyVectorEnv, as_array


def evaluate(
    policy: Any,
    task: str,
    seeds: Iterable[int] = range(50),
    *,
    name: str = "",
    keys: Keys = "gymnasium",
    environments: int = 1,
    progress: bool = True,
    **options: Any,
) -> EvaluationRecord:
    """Play episodes of a task with a policy, and record them.

    The record is that of `lerobot-eval --env.results_dir`: `lerobot-bimanual results` verifies, diagnoses, compares and reports
    its files. What the policy raises ends the evaluation.

    Args:
        policy: a callable from an observation to an action, 16 numbers for a tick or 18 of a keypose; or an object whose
            `select_action` is one. If it has a `reset`, that is called before each episode. The observation is that of
            `make_env`, with the instruction as `task`.
        task: name of the task.
        seeds: of the episodes, of the split `test` by default.
        name: what tables call the policy. A name in a `results_dir` stands for one policy: an evaluation that was interrupted
            goes on when it is called again; random numbers of the policy do not. Without it the folder must be a new one.
        keys: of the observation, as for `make_env`.
        environments: played side by side, each in a process of its own; a policy with `reset` plays one.
        progress: whether to show a bar, and at the end why episodes failed.
        options: of `EnvOptions`, such as `setting`, `variation`, `image_size`, `cameras`, `video_dir` and `results_dir`.

    Raises:
        BimanualError: an option is outside its choices, the folder holds another evaluation, or no action is of a length that
            the environment takes.
    """
    checked_keys(keys)
    if not isinstance(seeds, Iterable) or None in (seeds := [*seeds]):
        raise InvalidChoice("seeds", seeds, "integers, such as range(50)")
    requested_seeds = sorted({seed for each in seeds if (seed := checked_seed(each)) is not None})
    check_range("the number of seeds", len(requested_seeds), 1)
    check_range("environments", environments, 1)
    reset, act = getattr(policy, "reset", None), getattr(policy, "select_action", policy)
    if reset is not None and environments > 1:
        raise BimanualError("a policy with `reset` remembers one episode: evaluate it with environments=1")
    if (lerobot := sys.modules.get("lerobot.policies.pretrained")) and isinstance(
        policy, lerobot.PreTrainedPolicy
    ):
        raise BimanualError(
            "a LeRobot policy reads what its preprocessor makes: score its checkpoint with `lerobot-eval`"
        )
    chosen = EnvOptions.of(**options)
    with tempfile.TemporaryDirectory() as elsewhere:
        path = Path(chosen.results_dir or elsewhere) / record_name(task, chosen)
        if progress and (path.exists() or path.with_suffix(".partial.jsonl").exists()):
            tqdm.write(
                f"episodes that {path} has are not played again: choose another folder for another policy",
                file=sys.stderr,
            )
        envs = LazyVectorEnv(
            [partial(BimanualEnv, task, options=replace(chosen, results_dir=None))] * environments,
            asynchronous=environments > 1,
            evaluation=Evaluation(
                {"type": name} if name else {},
                requested_seeds,
                shows_bar=progress,
                is_kept=chosen.results_dir is not None,
            ),
            results_dir=str(path.parent),
        )
        try:
            for batch in batched(requested_seeds, environments):
                if reset is not None:
                    reset()
                _play(envs, act, batch, keys)
        finally:
            envs.close()
        record = EvaluationRecord.read(path).of_seeds(requested_seeds)  # the folder may hold further ones
    if progress:
        tqdm.write(f"{task}: {summary(record.episodes)}", file=sys.stderr)
    return record


def _play(envs: LazyVectorEnv, act: Any, seeds: Sequence[int], keys: Keys) -> None:
    """Play an episode of each seed."""
    # Fillers complete the batch. They get the last action, so that a wrong length is refused as without them.
    fillers = range(seeds[-1] + 1, seeds[-1] + 1 + envs.num_envs - len(seeds))
    observations, info = envs.reset(seed=[*seeds, *fillers])
    actions: list[Any] = [None] * envs.num_envs
    over = np.arange(envs.num_envs) >= len(seeds)
    while not over.all():
        for index, observation in enumerate(iterate(envs.observation_space, observations)):
            if not over[index]:
                seen = dataset_row(observation) if keys == "lerobot" else observation
                actions[index] = as_array(act(seen | {"task": str(info["instruction"][index])}))
        actions[len(seeds) :] = actions[len(seeds) - 1 : len(seeds)] * len(fillers)
        observations, _, terminated, truncated, info = envs.step(actions)
        over |= terminated | truncated

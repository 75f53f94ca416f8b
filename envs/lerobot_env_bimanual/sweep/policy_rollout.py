"""Rollouts of a trained policy by LeRobot's own loop, and the policy as a player of single episodes."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from typing import Any

import torch
from lerobot.configs import PreTrainedConfig
from lerobot.envs import make_env_pre_post_processors
from lerobot.policies import get_policy_class, make_policy, make_pre_post_processors
from lerobot.scripts.lerobot_eval import rollout
from lerobot.utils.constants import ACTION
from lerobot.utils.device_utils import get_safe_torch_device
from lerobot.utils.import_utils import register_third_party_plugins
from lerobot.utils.random_utils import get_rng_state, set_rng_state, set_seed

from lerobot_bimanual.errors import BimanualError
from lerobot_bimanual.keypose_layout import KEYPOSE_DIM
from lerobot_bimanual.results.evaluation import EvaluationRecord
from lerobot_env_bimanual.configuration_bimanual import BimanualEnvConfig
from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.episode.observations import dataset_row
from lerobot_env_bimanual.experts.runner import Move, Player
from lerobot_env_bimanual.processor_bimanual import RoundJointActions
from lerobot_env_bimanual.sweep.checkpoint import Checkpoint
from lerobot_env_bimanual.vector.evaluation import record_name
from lerobot_env_bimanual.vector.lerobot_evaluation import evaluation_of


class PolicyRollout:
    """LeRobot's own loop over vector environments, with LeRobot's own processors around the policy.

    Args:
        checkpoint: checkpoint of the policy; what it names is built and run, as `lerobot-eval` does.
        config: the nominal environment, of one task; its `perturb` and `results_dir` are set for each condition.
        batch_size: environments side by side.
        seeds: consecutive seeds of every condition; the first is also that of the policy's own randomness, as `--seed` of
            `lerobot-eval` is.
        policy_flags: settings of the policy's config over those of the checkpoint, such as `--device=cpu`.

    Raises:
        BimanualError: the policy cannot be built from the checkpoint, or not for this environment.
    """

    def __init__(
        self,
        checkpoint: Checkpoint,
        config: BimanualEnvConfig,
        batch_size: int,
        seeds: range,
        policy_flags: Sequence[str] = (),
    ):
        self._config, self._batch_size, self._seeds = config, batch_size, seeds
        folder = str(checkpoint.folder)
        register_third_party_plugins()
        try:
            policy_config = PreTrainedConfig.from_pretrained(folder, cli_overrides=[*policy_flags])
            policy_config.pretrained_path = checkpoint.folder
            self._evaluation = evaluation_of(policy_config, seeds)
            self._device = get_safe_torch_device(str(policy_config.device))
            set_seed(seeds.start)
            # LeRobot takes the shape of actions from the environment, which has that of joint actions in mode `auto`.
            action = (policy_config.output_features or {}).get(ACTION)
            is_keypose = action is not None and tuple(action.shape) == (KEYPOSE_DIM,)
            policy_env_config = replace(config, control_mode="keypose") if is_keypose else config
            self._policy = make_policy(policy_config, env_cfg=policy_env_config).eval()
            around_policy = _processors(
                policy_config, folder, rename_observations_processor={"rename_map": {}}
            )
            around_env = make_env_pre_post_processors(env_cfg=config, policy_cfg=policy_config)
        except BimanualError:
            raise
        except Exception as error:  # a policy of another package may fail in any way
            raise _not_loaded(folder, error) from error
        names = ("env_preprocessor", "env_postprocessor", "preprocessor", "postprocessor")
        self._processors = dict(zip(names, (*around_env, *around_policy), strict=True))
        self._random_state = get_rng_state()  # in which LeRobot's evaluation begins to play
        self._uses_amp = bool(policy_config.use_amp)
        # As in LeRobot's evaluation, whose bits depend on them on a GPU.
        torch.backends.cudnn.benchmark = True
        torch.backends.cuda.matmul.allow_tf32 = True

    def play(
        self, perturb: str, records: Path, note: Callable[[int], object] = lambda _: None
    ) -> EvaluationRecord:
        """Play the seeds in one condition, but for those that its record in the folder `records` has already.

        After every batch `note` is called with the number of its episodes.

        Raises:
            BimanualError: the environment cannot be built, or left no record; the folder holds the record of another policy;
                or the policy's actions are of a type that LeRobot's loop cannot take.
        """
        seeds = self._seeds
        config = replace(self._config, perturb=perturb, results_dir=str(records))
        ((task,),) = config.groups.values()
        path = records / record_name(task, config)
        set_rng_state(self._random_state)
        env = config.make_vector_env(task, self._batch_size, use_async_envs=True, evaluation=self._evaluation)
        autocast = torch.autocast(self._device.type) if self._uses_amp else nullcontext()
        try:
            with torch.no_grad(), autocast:
                for start in range(seeds.start, seeds.stop, self._batch_size):
                    batch = range(start, start + self._batch_size)
                    rollout(env, self._policy, **self._processors, seeds=list(batch))
                    note(min(batch.stop, seeds.stop) - start)
        except TypeError as error:
            # LeRobot's loop hands actions to NumPy, which has no bfloat16, the type of autocast on a CPU.
            if not self._uses_amp:
                raise
            raise BimanualError(
                f"the policy cannot be played in the precision it was trained in (use_amp): {error}; "
                "play it with --use_amp=false"
            ) from error
        finally:
            env.close()
        record = EvaluationRecord.read(path).of_seeds(seeds)
        if [episode.seed for episode in record.episodes] != list(seeds):
            raise BimanualError(f"{path} lacks episodes of the seeds {seeds.start}:{seeds.stop}")
        return record


def policy_player(folder: Path) -> Player:
    """The policy of a folder `pretrained_model` as a player, on the device of its config, in full precision.

    LeRobot calls what its processor files name, so check a checkpoint from others first.

    Raises:
        BimanualError: there is no checkpoint, or LeRobot cannot load it.
    """
    Checkpoint.read(folder)
    register_third_party_plugins()
    try:
        config = PreTrainedConfig.from_pretrained(folder)
        policy = get_policy_class(config.type).from_pretrained(folder, config=config)
        preprocess, postprocess = _processors(config, str(folder))
    except Exception as error:  # LeRobot passes on whatever a reader of files raises
        raise _not_loaded(str(folder), error) from error

    def play(env: BimanualEnv) -> Iterator[Move]:
        policy.reset()
        while True:
            row = dataset_row(env.observe())
            batch = {key: torch.from_numpy(array)[None] for key, array in row.items()}
            with torch.inference_mode():
                observation = preprocess(batch | {"task": [env.task_description]})
                action = RoundJointActions().action(postprocess(policy.select_action(observation)))
            yield Move("predicted", action[0].to("cpu").numpy())

    return play


def _processors(config: PreTrainedConfig, folder: str, **overrides: dict[str, Any]) -> tuple[Any, Any]:
    """LeRobot's processors before and behind a policy, on the device of its config."""
    overrides["device_processor"] = {"device": str(config.device)}
    return make_pre_post_processors(config, pretrained_path=folder, preprocessor_overrides=overrides)


def _not_loaded(folder: str, error: Exception) -> BimanualError:
    reason = " ".join(str(error).split()) or type(error).__name__
    return BimanualError(
        f"LeRobot cannot load the checkpoint at {folder}: {reason}; `lerobot-bimanual policy check` looks at its parts"
    )

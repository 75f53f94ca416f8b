"""The base of all keypose policies: LeRobot's policy interface around a network that predicts the next keypose."""

from abc import abstractmethod
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, Self

import torch
from huggingface_hub import ModelCard
from lerobot.configs import PreTrainedConfig
from lerobot.policies.pretrained import PreTrainedPolicy
from torch import Tensor, nn

from lerobot_bimanual.codec_torch import KeyposeBins
from lerobot_bimanual.dataset.calibration import Calibration
from lerobot_bimanual.dataset.schema import ACTION, image_key
from lerobot_bimanual.errors import InvalidChoice, plain
from lerobot_policy_bimanual.errors import CheckpointError
from lerobot_policy_bimanual.keypose.augmentation import move_keyposes, sample_motions
from lerobot_policy_bimanual.keypose.config import (
    CLIP_PREFIX,
    LEARNED_LANGUAGE,
    WORDLLAMA,
    KeyposePolicyConfig,
)
from lerobot_policy_bimanual.keypose.dataset_fit import check_label, compare_with_checkpoint, fit_config
from lerobot_policy_bimanual.keypose.losses import keypose_errors, keypose_losses
from lerobot_policy_bimanual.keypose.observation import Observation, observe, with_calibration
from lerobot_policy_bimanual.keypose.observation_check import ObservationCheck
from lerobot_policy_bimanual.nn.clip import ClipLanguage
from lerobot_policy_bimanual.nn.language import LearnedLanguage
from lerobot_policy_bimanual.nn.precision import full_precision
from lerobot_policy_bimanual.nn.prediction import KeyposePrediction
from lerobot_policy_bimanual.nn.wordllama import WordllamaLanguage

REDUCTIONS = ("mean", "none")
CARD = """
It reads images with depth of {cameras} and an instruction, and answers with the next keypose of both arms. Install its packages,
and score it on a task of its dataset (`lerobot-bimanual task list` names all), with the dataset's `--env.setting`:

```bash
pip install 'lerobot_env_bimanual[lerobot]' 'lerobot_policy_bimanual{extra}'
lerobot-eval --policy.path={repo_id} --env.type=bimanual --env.task=TASK --env.image_size={size}
```
"""


class KeyposePolicy(PreTrainedPolicy):
    """Predicts, from one RGB-D observation, the next keypose of both arms.

    A subclass defines the network and its input. The policy keeps no state between calls: the observation counts the
    keyposes executed so far.

    Args:
        config: the policy's config.
        dataset_stats: statistics of the dataset, which LeRobot passes in training; see `keypose.dataset_fit`.
        dataset_meta: metadata of the dataset, likewise.
        **kwargs: other arguments of LeRobot, not used.

    Attributes:
        calibration: what holds for all rows of the dataset of a training, and completes its batches; None without one.
    """

    config: KeyposePolicyConfig  # pyright: ignore[reportIncompatibleVariableOverride]
    config_class = KeyposePolicyConfig  # pyright: ignore[reportAssignmentType]
    name = "keypose"  # pyright: ignore[reportAssignmentType]
    # Units of FSDP's sharding, by the attribute of LeRobot 0.7 and by accelerate's.
    _fsdp_wrap_modules = ("Attention", "FeedForward")
    _no_split_modules = _fsdp_wrap_modules

    def __init__(
        self,
        config: KeyposePolicyConfig,
        dataset_stats: Mapping[str, Mapping[str, Any]] | None = None,
        dataset_meta: Any = None,
        **kwargs: Any,
    ):
        super().__init__(config)
        fit_config(config, dataset_meta, dataset_stats)
        config.validate_features()
        self.calibration = None if dataset_meta is None else Calibration.of_features(dataset_meta.features)
        self.codec = config.codec
        self.language = _make_language(config)
        self.network = self.make_network()
        self._check_observation = ObservationCheck(config)

    @classmethod
    def from_pretrained(  # pyright: ignore[reportIncompatibleMethodOverride]
        cls, pretrained_name_or_path: str | Path, *, config: PreTrainedConfig | None = None, **kwargs: Any
    ) -> Self:
        """Load a checkpoint as LeRobot does, unless the config contradicts it.

        Raises:
            BadConfig: as in `compare_with_checkpoint`.
            CheckpointError: as in `load_state_dict`.
        """
        if config is not None:
            trained = PreTrainedConfig.from_pretrained(pretrained_name_or_path, **kwargs)
            compare_with_checkpoint(config, trained, pretrained_name_or_path)
        return super().from_pretrained(pretrained_name_or_path, config=config, **kwargs)

    @abstractmethod
    def make_network(self) -> nn.Module:
        """A new network, called as `network(scene, proprio, language, target)`, which predicts both arms."""

    @abstractmethod
    def scene(self, observation: Observation) -> Any:
        """Convert the cloud to the network's input."""

    def predict(self, observation: Observation, target: KeyposeBins | None) -> KeyposePrediction:
        """Run the network, in the precision of the config.

        Args:
            observation: the cloud, proprioception and instructions.
            target: the label in training, for heads that are conditioned on it; None at inference.
        """
        enabled = self.config.dtype == "bfloat16"
        with torch.autocast(observation.points.device.type, torch.bfloat16, enabled=enabled):
            language = self.language(observation.instructions)
            return self.network(self.scene(observation), observation.proprio, language, target)

    def load_state_dict(
        self, state_dict: Mapping[str, Tensor], strict: bool = True, assign: bool = False
    ) -> Any:
        """Load exactly the weights of the network; LeRobot by default only warns of missing and unknown ones.

        Raises:
            CheckpointError: weights are missing, unknown or of another shape.
        """
        try:
            return super().load_state_dict(state_dict, True, assign)
        except RuntimeError as error:
            raise CheckpointError(
                f"the checkpoint is not of the network of its config: {plain(error)}"
            ) from error

    def generate_model_card(self, *args: Any, **kwargs: Any) -> ModelCard:  # pyright: ignore[reportIncompatibleMethodOverride]
        """LeRobot's card for the Hub, with what must be installed and the command that scores the policy in simulation."""
        card = super().generate_model_card(*args, **kwargs)
        cameras, features = self.config.cameras, self.config.input_features or {}
        size = "x".join(map(str, features[image_key(cameras[0])].shape[-2:]))
        encoder = self.config.language_encoder
        extra = {LEARNED_LANGUAGE: "", WORDLLAMA: "[words]"}.get(encoder, "[clip]")
        ours = CARD.format(cameras=", ".join(cameras), repo_id=self.config.repo_id, size=size, extra=extra)
        card.text = card.text.replace("\n---\n", f"{ours}\n---\n", 1)
        return card

    def get_optim_params(self) -> list[Tensor]:  # pyright: ignore[reportIncompatibleMethodOverride]
        """All trained parameters."""
        return [parameter for parameter in self.parameters() if parameter.requires_grad]

    def reset(self) -> None:
        """Do nothing: the policy keeps no state."""

    def forward(self, batch: dict[str, Any], reduction: str = "mean") -> tuple[Tensor, dict[str, float]]:  # pyright: ignore[reportIncompatibleMethodOverride]
        """Training loss on a batch with labels.

        Args:
            batch: the keys of `keypose.observation.observe`, and `action` (b, 18), the next keypose.
            reduction: `mean` over the batch, or `none` for the losses (b,) of its samples, which LeRobot then weighs.

        Returns:
            The loss, and its parts in nats with prediction errors per arm in cm and degrees, averaged over the batch.

        Raises:
            InvalidChoice: another reduction.
            DatasetError: as in `check_label`.
            BadObservation: as in `observe`.
        """
        if reduction not in REDUCTIONS:
            raise InvalidChoice("reduction", reduction, REDUCTIONS)
        check_label(batch[ACTION].shape[1:] if ACTION in batch else ())
        keyposes = batch[ACTION].float()
        with full_precision(keyposes.device):
            motion = None
            if self.training and self.config.augmentation:
                motion = sample_motions(keyposes, self.config)
                keyposes = move_keyposes(motion, keyposes)
            observation = self.observe(batch, motion)
            target = self.target_bins(keyposes)
        prediction = self.predict(observation, target)
        with full_precision(keyposes.device):
            of_samples = keypose_losses(prediction, target)
            losses = {part: values.mean() for part, values in of_samples.items()}
            loss = torch.stack(list((of_samples if reduction == "none" else losses).values())).sum(dim=0)
            errors = keypose_errors(self._decode(prediction), keyposes)
            report = {f"{part}_loss": value for part, value in losses.items()} | errors
            # One transfer from the device for all numbers.
            values = torch.stack([value.detach() for value in report.values()]).tolist()
        return loss, dict(zip(report, values, strict=True))

    def predict_action_chunk(self, batch: dict[str, Any], **kwargs: Any) -> Tensor:  # pyright: ignore[reportIncompatibleMethodOverride]
        """The next keypose as a chunk of one action, (b, 1, 18)."""
        return self.select_action(batch)[:, None]

    def select_action(self, batch: dict[str, Any], **kwargs: Any) -> Tensor:  # pyright: ignore[reportIncompatibleMethodOverride]
        """The next keypose of both arms, (b, 18) in the layout of `lerobot_bimanual.keypose`.

        A label in the batch is ignored.

        Raises:
            BadObservation: as in `observe`.
        """
        return self.infer(batch)[2]

    @torch.no_grad()
    def infer(self, batch: dict[str, Any]) -> tuple[Observation, KeyposePrediction, Tensor]:
        """Return the observation, the prediction, and the chosen next keypose (b, 18)."""
        self.eval()
        device = next(self.parameters()).device
        with full_precision(device):
            observation = self.observe(batch)
        prediction = self.predict(observation, None)
        with full_precision(device):
            return observation, prediction, self._decode(prediction)

    def observe(self, batch: dict[str, Any], motion: Tensor | None = None) -> Observation:
        """Convert a batch to an observation, moved by (b, 4, 4) world-frame transforms if there are any.

        Raises:
            BadObservation: something is missing, of another shape, or cannot be true.
        """
        batch = with_calibration(batch, self.calibration)
        self._check_observation(batch)
        return observe(
            batch,
            cameras=self.config.cameras,
            keypose_horizon=self.config.keypose_horizon if self.config.use_keypose_step else None,
            motion=motion,
        )

    def target_bins(self, keyposes: Tensor) -> KeyposeBins:
        """Bins of the labels, with positions outside the workspace in its nearest voxel."""
        bins = self.codec.encode(keyposes)
        return replace(bins, voxel=bins.voxel.clamp(0, self.codec.voxels - 1))

    def _decode(self, prediction: KeyposePrediction) -> Tensor:
        best = prediction.best()
        if self.config.decode == "voxel":
            return self.codec.decode(best)
        return self.codec.assemble(self.codec.voxel_centers(best.voxel_position), best)


def _make_language(config: KeyposePolicyConfig) -> nn.Module:
    sizes = {"tokens": config.language_tokens, "dim": config.language_dim}
    if config.language_encoder == LEARNED_LANGUAGE:
        return LearnedLanguage(**sizes)
    if config.language_encoder == WORDLLAMA:
        return WordllamaLanguage(**sizes)
    return ClipLanguage(config.language_encoder.removeprefix(CLIP_PREFIX), **sizes)

"""What all keypose policies have in common in their configs."""

from dataclasses import dataclass, field

import numpy as np
from lerobot.configs import FeatureType, NormalizationMode, PolicyFeature, PreTrainedConfig
from lerobot.optim import CosineDecayWithWarmupSchedulerConfig, LRSchedulerConfig, OptimizerConfig

from lerobot_bimanual.cameras import CAMERA_NAMES
from lerobot_bimanual.codec_torch import TorchKeyposeCodec
from lerobot_bimanual.dataset import schema
from lerobot_bimanual.errors import DatasetError, InvalidChoice
from lerobot_bimanual.geometry.workspace import VOXEL_WORKSPACE, Workspace
from lerobot_bimanual.keypose_layout import KEYPOSE_DIM, divides_circle
from lerobot_policy_bimanual.errors import BadConfig
from lerobot_policy_bimanual.keypose.fields import check_fields, choice, number
from lerobot_policy_bimanual.keypose.optimizers import FusedAdamWConfig, LambConfig

LEARNED_LANGUAGE = "learned"
WORDLLAMA = "wordllama"
SELF_CONTAINED = (LEARNED_LANGUAGE, WORDLLAMA)
"""Encoders that load no file but one of an installed package."""
CLIP_PREFIX = "clip:"

SCHEDULE_STEPS = 1_000_000
"""LeRobot shrinks a longer schedule to the length of the training, so this fits any length."""


@dataclass
class KeyposePolicyConfig(PreTrainedConfig):
    """Base config of policies that predict the next keypose of both arms.

    The comment above or beside a field is its help text on LeRobot's command lines.
    """

    # IDENTITY for all: the policy normalises inside, with constants. LeRobot's statistics would treat depth and
    # calibration like any other image or state.
    normalization_mapping: dict[str, NormalizationMode] = field(
        default_factory=lambda: dict.fromkeys(("VISUAL", "STATE", "ACTION"), NormalizationMode.IDENTITY)
    )
    push_to_hub: bool = False  # to the Hub, which needs --policy.repo_id
    # RGB-D cameras to use, any subset of the five, as in `["front", "left_wrist"]`.
    cameras: tuple[str, ...] = CAMERA_NAMES
    # Lower corner of the workspace in metres. Keyposes outside it cannot be predicted.
    workspace_lower: tuple[float, float, float] = number(VOXEL_WORKSPACE.lower, -100, 100)
    # Upper corner of the workspace in metres.
    workspace_upper: tuple[float, float, float] = number(VOXEL_WORKSPACE.upper, -100, 100)
    # Voxels per axis (the field's name for it). 100 in simulation, 50 on the paper's real robot.
    voxel_size: int = number(100, 1, 512)
    # Width of the rotation bins in degrees; 5 makes 72 bins per axis.
    rotation_bin_deg: float = number(5.0, 0.5, 180)
    # Tell the network how many keyposes were executed, as the paper does. Experts take a constant number of keyposes, so
    # the count tells the stage of the task.
    use_keypose_step: bool = True
    # Keyposes over which the time feature falls from +1 to -1. When it is not set, a new policy takes one more than the
    # most keyposes of any episode in its dataset, also one that `--dataset.episodes` leaves out (PerAct2 code: 25 for all
    # tasks). Fewer make it a stronger signal for short tasks.
    keypose_horizon: int | None = number(None, 2, 1000, unset=True)
    # `voxel` commands the centre of the most probable voxel (the paper's), `expectation` the mean over the 3x3x3 voxels
    # around it, which voxels of 4 cm need.
    decode: str = choice("voxel", "expectation")

    # Channels of the features of a voxel or pixel.
    channels: int = number(64, 1, 1024)
    # Heads of the self-attentions.
    heads: int = number(8, 1, 128)
    # Inner over outer width of the feed-forwards.
    feedforward_multiplier: int = number(4, 1, 16)
    # Dropout of attention weights.
    attention_dropout: float = number(0.1, 0, 0.9)

    # `learned`, trained with the policy, `wordllama` on frozen vectors of words, or `clip:<local path or hub id>` for the
    # paper's frozen CLIP tokens.
    language_encoder: str = LEARNED_LANGUAGE
    # Tokens per instruction (CLIP: 77).
    language_tokens: int = number(77, 1, 1024)
    # Width of a language token (CLIP: 512).
    language_dim: int = number(512, 1, 8192)
    # Add language-conditioned filters to the first layer, which find a colour or a height anywhere (departure from the
    # paper). A dense translation head has none.
    language_filters: bool = False

    # `bfloat16` runs the network under autocast. Geometry, softmax and losses stay in `float32`.
    dtype: str = choice("float32", "bfloat16")
    # Compile the network with torch.compile at its first use.
    compile: bool = False

    # Move the scene and its labels at random during training.
    augmentation: bool = True
    # Largest shift along x, y, z in metres (paper: an eighth of a metre).
    augmentation_shift_m: tuple[float, float, float] = number((0.125, 0.125, 0.125), 0, 10)
    # Largest rotation about the vertical in degrees (paper: 45). Learning in minutes instead of days wants less.
    augmentation_yaw_deg: float = number(45.0, 0, 180)
    # Rotations are multiples of this, in degrees (PerAct2 code: 5).
    augmentation_yaw_step_deg: float = number(5.0, 0.01, 180)

    # `adamw`, or `lamb` as in PerAct2's code, which trained at 5e-4 without warm-up.
    optimizer: str = choice("adamw", "lamb")
    # Learning rate.
    optimizer_lr: float = number(5e-4, 1e-12, 10)
    # Weight decay.
    optimizer_weight_decay: float = number(1e-2, 0, 10)
    # Largest gradient norm; 0 for no clipping.
    optimizer_grad_clip_norm: float = number(5.0, 0, 1e6)
    # `cosine` (with warm-up) or `constant` (PerAct2 code).
    lr_schedule: str = choice("cosine", "constant")
    # Share of the training steps in which the learning rate rises.
    warmup_fraction: float = number(0.05, 0, 1)
    # Learning rate at the end over the one at the peak.
    final_lr_fraction: float = number(0.02, 0, 1)

    # Tags of the policy's card on the Hub; the default names what to install.
    tags: list[str] | None = field(default_factory=lambda: ["lerobot_policy_bimanual"])
    trained_instructions: tuple[str, ...] = ()  # all of its dataset, filled in by training
    # Task -> version of the world of its demonstrations, likewise; evaluations say where they play in another one.
    trained_worlds: dict[str, str] = field(default_factory=dict)

    def __post_init__(self):
        """Refuse values that no policy can work with.

        Raises:
            BadConfig: a value is of another type or out of its range, or values do not fit together.
            InvalidChoice: a word is not among the choices, or a camera does not exist.
        """
        super().__post_init__()
        check_fields(self)
        encoder = self.language_encoder
        if encoder not in SELF_CONTAINED and not str(encoder).startswith(CLIP_PREFIX):
            allowed = (*SELF_CONTAINED, f"{CLIP_PREFIX}<local path or hub id>")
            raise InvalidChoice("language_encoder", encoder, allowed)
        if self.cameras and all(len(camera) == 1 for camera in self.cameras):
            # LeRobot's parser makes letters of a text, and of a list that has lost its quotes in a shell.
            raise BadConfig(
                f"cameras is {''.join(self.cameras)!r}, but must be a list whose names are quoted, as in "
                """--policy.cameras='["front","left_wrist"]'"""
            )
        for camera in self.cameras:
            if camera not in CAMERA_NAMES:
                raise InvalidChoice("cameras", camera, CAMERA_NAMES)
        if not self.cameras or len(set(self.cameras)) < len(self.cameras):
            raise BadConfig(f"cameras={list(self.cameras)} must name at least one camera, and none twice")
        if not np.less(self.workspace_lower, self.workspace_upper).all():
            raise BadConfig(
                f"workspace_lower={list(self.workspace_lower)} must be below "
                f"workspace_upper={list(self.workspace_upper)} on every axis"
            )
        if 0 < self.augmentation_yaw_deg < self.augmentation_yaw_step_deg:
            raise BadConfig(
                f"augmentation_yaw_deg={self.augmentation_yaw_deg} is less than a step of augmentation_yaw_step_deg="
                f"{self.augmentation_yaw_step_deg}, so that nothing would be turned: set 0, or a smaller step"
            )
        if not divides_circle(self.rotation_bin_deg):
            raise BadConfig(f"rotation_bin_deg={self.rotation_bin_deg} must divide 360")
        if self.use_amp:
            raise BadConfig("use_amp=True has no effect on this policy: leave it out, and set dtype=bfloat16")
        if self.n_obs_steps != 1 or set(self.normalization_mapping.values()) != {NormalizationMode.IDENTITY}:
            raise BadConfig(
                f"n_obs_steps={self.n_obs_steps} must be 1, and normalization_mapping must be IDENTITY for all: "
                "the policy normalises one observation itself, with constants"
            )

    @property
    def workspace(self) -> Workspace:
        """The box that keyposes must lie in."""
        return Workspace(self.workspace_lower, self.workspace_upper)

    @property
    def codec(self) -> TorchKeyposeCodec:
        """The discretisation of keyposes."""
        return TorchKeyposeCodec(self.workspace, self.voxel_size, self.rotation_bin_deg)

    @property
    def observation_keys(self) -> tuple[str, ...]:
        """Batch keys that the policy reads, apart from `task`."""
        images = [key(camera) for camera in self.cameras for key in (schema.image_key, schema.depth_key)]
        return (*images, *self.vector_keys)

    @property
    def vector_keys(self) -> tuple[str, ...]:
        """The keys among `observation_keys` of vectors, not images."""
        always = (schema.CAMERA_EXTRINSICS, schema.CAMERA_INTRINSICS, schema.STATE, schema.GRIPPER_FINGERS)
        return (*always, schema.KEYPOSE_STEP) if self.use_keypose_step else always

    def validate_features(self) -> None:
        """Keep the inputs that the policy reads, check that none is missing, and name its output.

        Unused cameras and vectors are removed, so that a checkpoint does not require them. The output is a keypose, also where
        LeRobot has put the joint action of an environment there.

        Raises:
            DatasetError: if inputs are listed but some are missing.
        """
        self.output_features = {schema.ACTION: PolicyFeature(FeatureType.ACTION, (KEYPOSE_DIM,))}
        if not self.input_features:
            return
        calibration = {
            key: PolicyFeature(FeatureType.STATE, (len(schema.VECTORS[key]),))
            for key in (schema.CAMERA_EXTRINSICS, schema.CAMERA_INTRINSICS)
        }
        known = self.input_features | calibration  # which a dataset's metadata complete
        missing = [key for key in self.observation_keys if key not in known]
        if missing:
            raise DatasetError(
                f"policy inputs {', '.join(missing)} are neither in the dataset nor inputs of the checkpoint. Record RGB-D data "
                "with `lerobot-bimanual dataset generate`, or choose cameras with --policy.cameras"
            )
        self.input_features = {key: known[key] for key in self.observation_keys}

    def get_optimizer_preset(self) -> OptimizerConfig:
        """The optimizer of `optimizer*`."""
        config = LambConfig() if self.optimizer == "lamb" else FusedAdamWConfig(betas=(0.9, 0.99))
        config.lr, config.weight_decay = self.optimizer_lr, self.optimizer_weight_decay
        config.grad_clip_norm = self.optimizer_grad_clip_norm
        return config

    def get_scheduler_preset(self) -> LRSchedulerConfig | None:
        """Warm-up and cosine over the whole training, however long, or nothing."""
        if self.lr_schedule == "constant":
            return None
        return CosineDecayWithWarmupSchedulerConfig(
            num_warmup_steps=round(self.warmup_fraction * SCHEDULE_STEPS),
            num_decay_steps=SCHEDULE_STEPS,
            peak_lr=self.optimizer_lr,
            decay_lr=self.final_lr_fraction * self.optimizer_lr,
        )

    # One observation is enough, and one action, and rewards are not used.
    observation_delta_indices = action_delta_indices = reward_delta_indices = property(lambda self: None)  # pyright: ignore

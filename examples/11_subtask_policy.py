"""A policy of LeRobot that is told its subtask: Multi-Task DiT, whose CLIP reads "lift the ball: squeeze".

lerobot-bimanual dataset generate --task=lift_ball --episodes=10 --view=both --root=data/lift_ball
python examples/10_subtasks.py --root=data/lift_ball
python examples/11_subtask_policy.py --root=data/lift_ball/frames --clip=models/clip-vit-base-patch16 --output=outputs/dit
lerobot-bimanual-train --policy.path=outputs/dit --dataset.repo_id=local/lift_ball --dataset.root=data/lift_ball/frames \\
    --trust_checkpoint=true --policy.push_to_hub=false --steps=20000 --output_dir=outputs/dit_trained

It needs `pip install 'lerobot[multi_task_dit]'` and a folder with a CLIP of transformers, text and images. What is written is a
policy that knows nothing yet, with its preprocessor, to train from. docs/datasets.md says who reads language columns and who
does not.
"""

import argparse
from pathlib import Path

from lerobot.configs import FeatureType, PolicyFeature
from lerobot.datasets import LeRobotDatasetMetadata
from lerobot.policies.factory import make_policy, make_pre_post_processors
from lerobot.policies.multi_task_dit.configuration_multi_task_dit import MultiTaskDiTConfig
from transformers import CLIPVisionConfig

from lerobot_bimanual.dataset import schema
from lerobot_policy_bimanual.training.subtask_step import SubtaskStep

parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
parser.add_argument("--root", type=Path, required=True, help="the `frames` view of a dataset with subtasks")
parser.add_argument("--clip", required=True, help="a folder with a CLIP; its name must hold `clip`")
parser.add_argument("--output", type=Path, required=True, help="where the policy is written")
parser.add_argument("--cameras", default="front,left_wrist,right_wrist", help="what it sees")
parser.add_argument("--hidden_dim", type=int, default=256, help="width of the transformer")
parser.add_argument("--num_layers", type=int, default=4, help="depth of the transformer")
arguments = parser.parse_args()

side = CLIPVisionConfig.from_pretrained(arguments.clip).image_size
metadata = LeRobotDatasetMetadata("local/subtasks", root=arguments.root)
keys = [schema.image_key(camera) for camera in arguments.cameras.split(",")]
shapes = {key: metadata.features[key]["shape"] for key in (schema.STATE, *keys)}
config = MultiTaskDiTConfig(
    vision_encoder_name=arguments.clip,
    text_encoder_name=arguments.clip,
    hidden_dim=arguments.hidden_dim,
    num_layers=arguments.num_layers,
    image_resize_shape=(side, side),
    image_crop_shape=None,
    device="cpu",
    input_features={
        schema.STATE: PolicyFeature(FeatureType.STATE, shapes[schema.STATE]),
        **{key: PolicyFeature(FeatureType.VISUAL, (3, *shapes[key][:2])) for key in keys},
    },
)
policy = make_policy(config, ds_meta=metadata)
preprocessor, postprocessor = make_pre_post_processors(config, dataset_stats=metadata.stats)
preprocessor.steps = [SubtaskStep(), *preprocessor.steps]
for part in (policy, preprocessor, postprocessor):
    part.save_pretrained(arguments.output)
print(
    f"{arguments.output}: {sum(weight.numel() for weight in policy.parameters()) / 1e6:.1f} M numbers to train from"
)

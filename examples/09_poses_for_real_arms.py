"""What a keypose policy asks of real arms: feed it recorded camera frames, and print where each hand should go.

python examples/09_poses_for_real_arms.py --dataset=data/handover --episode=0

The frames come from a dataset here. On real arms `observe` is the only part to replace: it returns what cameras,
calibration and grippers say. docs/hardware.md says what the policy needs of them, and what becomes of the poses.
"""

import argparse
from pathlib import Path

import numpy as np
from lerobot.datasets import LeRobotDataset

from lerobot_bimanual.arms import ARMS
from lerobot_bimanual.keypose import BimanualKeypose
from lerobot_policy_bimanual.inspection.loading import batch_of, load_policy

CHECKPOINT = Path(__file__).parents[1] / "results/checkpoints/peract2_on_all"


def observe(dataset: LeRobotDataset, index: int) -> dict:
    """One moment as the sensors give it: left arm first, metres, and the frame that the arms are commanded in.

    RGB (3, h, w) from 0 to 1 and depth (1, h, w) in millimetres of each camera, five world_T_camera and five pinhole
    matrices as flat vectors, joints and openings (16,), finger positions (4,), and how many keyposes have been executed.
    """
    # A batch of one row, with the calibration that the dataset's metadata hold for all.
    return batch_of(dataset, [index])


parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
parser.add_argument(
    "--dataset", type=Path, required=True, help="one view that `lerobot-bimanual dataset generate` made"
)
parser.add_argument("--checkpoint", type=Path, default=CHECKPOINT)
parser.add_argument("--episode", type=int, default=0)
arguments = parser.parse_args()

# It looks at the checkpoint first: LeRobot's own loader would call whatever class a stranger's file names.
policy, preprocess = load_policy(arguments.checkpoint)
episode = LeRobotDataset(
    f"local/{arguments.dataset.name}", root=arguments.dataset, episodes=[arguments.episode]
)
policy.reset()
for index in range(len(episode) - 1):  # in the last row all keyposes have been executed
    row = episode[index]
    batch = preprocess(observe(episode, index))
    action = policy.select_action(batch)[0].cpu().numpy()
    answer, shown = (BimanualKeypose.from_vector(vector) for vector in (action, row["action"]))
    print(f"{row['task']!r}, {round(row['observation.keypose_step'].item())} keyposes executed")
    for arm in ARMS:
        target = answer[arm]
        error_cm = 100 * np.linalg.norm(target.pose.position - shown[arm].pose.position)
        print(
            f"  {arm:5} hand: position {target.pose.position.round(3)} m, quat_wxyz {target.pose.quat_wxyz.round(3)}, "
            f"{'open' if target.gripper_open else 'closed'}, "
            f"{'straight' if target.ignore_collisions else 'around obstacles'}; {error_cm:.1f} cm from the demonstrated one"
        )

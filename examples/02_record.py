"""Record an expert's demonstrations as LeRobot datasets, and look at one row of them.

python examples/02_record.py --task=lift_ball --episodes=3 --output=outputs/record
"""

import argparse
from pathlib import Path

from lerobot.datasets.lerobot_dataset import LeRobotDataset

from lerobot_env_bimanual.commands.dataset_generate import DatasetGenerateConfig, dataset_generate


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--task", default="lift_ball")
    parser.add_argument("--episodes", type=int, default=3)
    parser.add_argument("--image_size", default="128")
    parser.add_argument("--output", type=Path, default=Path("outputs/record"))
    arguments = parser.parse_args()

    # What `lerobot-bimanual dataset generate` does. The same arguments again find everything there.
    dataset_generate(
        DatasetGenerateConfig(
            task=arguments.task,
            episodes=arguments.episodes,
            image_size=arguments.image_size,
            root=arguments.output,
            view="both",
        )
    )

    # Two views of the same episodes: every tick with its joint action, and the moments at which a keypose was reached, with
    # the next one.
    for view in ("frames", "keyframes"):
        dataset = LeRobotDataset(f"local/{view}", root=arguments.output / view)
        print(
            f"{view}: {dataset.num_episodes} episodes, {dataset.num_frames} rows, {dataset.meta.shapes['action'][0]} numbers per action"
        )

    row = dataset[0]
    print(f'the first row of keyframes, "{row["task"]}":')
    for key, value in row.items():
        if key.startswith(("observation.", "action")):
            print(f"  {key:40} {tuple(value.shape)} {value.dtype}")
    left_hand = row["action"][:3]
    print("where the left hand goes next, in metres:", left_hand.numpy().round(3))


if __name__ == "__main__":  # worker processes import this file
    main()

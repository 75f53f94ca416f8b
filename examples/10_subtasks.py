"""Write the names of the expert's stages into a dataset, in the columns that LeRobot keeps for language.

lerobot-bimanual dataset generate --task=lift_ball --episodes=10 --view=both --root=data/lift_ball
python examples/10_subtasks.py --root=data/lift_ball
lerobot-bimanual dataset verify --root=data/lift_ball

The stages of experts have names. `dataset generate` leaves these out, as LeRobot's recorder has no language columns; LeRobot
adds such columns to finished datasets, and so does this script. docs/datasets.md says who reads them.
"""

import argparse
import tempfile
from pathlib import Path

from lerobot.annotations.steerable_pipeline.reader import iter_episodes
from lerobot.annotations.steerable_pipeline.staging import EpisodeStaging
from lerobot.annotations.steerable_pipeline.writer import LanguageColumnsWriter
from lerobot.datasets import LeRobotDataset
from lerobot.datasets.io_utils import load_info, write_info
from lerobot.datasets.language import language_feature_info

from lerobot_bimanual.dataset.checksums import write_checksums
from lerobot_bimanual.dataset.provenance import EpisodeKey, Provenance
from lerobot_bimanual.dataset.schema import KEYPOSE_STEP
from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.experts.runner import expert, replanning, run_episode


def stage_names(made: Provenance, key: EpisodeKey) -> list[str]:
    """The expert's stages of an episode, which its key and the settings of its dataset determine."""
    world = {"split": key.split, "setting": made.setting, "perturb": made.perturb}
    env = BimanualEnv(key.task, obs="state", control_mode="keypose", **world)
    names: list[str] = []
    player = expert(plan=key.plan) if key.plan else replanning()
    run_episode(env, key.seed, player, lambda move: names.append(move.name), key.variation)
    env.close()
    return names


def annotate(view: Path) -> None:
    """Write the language columns of one view, declare them, and write its checksums again."""
    made = Provenance.of_dataset(view)
    if made is None:
        raise SystemExit(
            f"{view} does not say how it was made: only what `dataset generate` wrote is annotated"
        )
    episodes = list(iter_episodes(view))
    with tempfile.TemporaryDirectory() as folder:
        for episode in episodes:
            rows = episode.frames_df()
            names = stage_names(made, made.episodes[episode.episode_index])
            begins_s = rows.groupby(KEYPOSE_STEP)["timestamp"].first()
            subtasks = [
                {"role": "assistant", "style": "subtask", "content": name, "timestamp": float(begins_s[step])}
                for step, name in enumerate(names)
            ]
            EpisodeStaging(Path(folder), episode.episode_index).write("plan", subtasks)
        LanguageColumnsWriter().write_all(episodes, Path(folder), view)
    info = load_info(view)
    info.features = {**info.features, **language_feature_info()}
    write_info(info, view)
    write_checksums(view)


parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
parser.add_argument(
    "--root", type=Path, required=True, help="what `lerobot-bimanual dataset generate` was given"
)
arguments = parser.parse_args()

for view in sorted(path.parent.parent for path in arguments.root.glob("**/meta/info.json")):
    annotate(view)
    for subtask in LeRobotDataset(f"local/{view.name}", root=view)[0]["language_persistent"]:
        print(f"{view}: from timestamp {subtask['timestamp']:.2f} on: {subtask['content']}")

"""Arms that start elsewhere than at home."""

import numpy as np

from lerobot_bimanual.arms import ARMS, JOINTS_PER_ARM
from lerobot_env_bimanual.episode.reset import EpisodeStart
from lerobot_env_bimanual.perturbations.axis import Axis, Group
from lerobot_env_bimanual.perturbations.registry import register
from lerobot_env_bimanual.world.scene import Scene

DRAWS = 20


@register
class StartPosture(Axis):
    """Other views of the wrist cameras, and other ways to the first keypose."""

    name = "start_posture"
    group = Group.ARMS
    levels = (3, 6, 12)
    unit = "degrees in each joint, at most"
    summary = "both arms start in a drawn posture about home from which the task can be done"
    source = "chosen here: from a homing that stops early to arms left where somebody had guided them"

    def begin(self, start: EpisodeStart, magnitude: float, rng: np.random.Generator) -> None:
        """Take the first of some drawn postures that touches nothing and is feasible; else stay at home."""
        scene = start.scene
        home = np.array([scene.joint_positions(arm) for arm in ARMS])
        for shares in rng.uniform(-1.0, 1.0, (DRAWS, len(ARMS), JOINTS_PER_ARM)):
            scene.pose_arms(home + np.deg2rad(magnitude) * shares)
            if not _arms_touch(scene) and start.is_feasible():
                return
        scene.pose_arms(home)


def _arms_touch(scene: Scene) -> bool:
    """Whether an arm touches anything, itself included."""
    model = scene.model
    bases = [model.body(scene.arm_pair.base_body(arm)).id for arm in ARMS]
    contact = scene.data.contact
    roots = model.body_rootid[model.geom_bodyid[contact.geom.reshape(-1, 2)]]
    return bool((np.isin(roots, bases).any(axis=1) & (contact.dist < 0)).any())

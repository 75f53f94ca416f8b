"""Paces of motions: the shares of the arms' limits that they use; slower beside heavy things."""

from dataclasses import dataclass

import numpy as np

from lerobot_bimanual.arms import Arm
from lerobot_env_bimanual.gl import mujoco
from lerobot_env_bimanual.motion.carrying import is_free
from lerobot_env_bimanual.motion.time_law import MotionLimits
from lerobot_env_bimanual.robots.panda_pair import JointLimits
from lerobot_env_bimanual.world.arena import PHYSICS_STEP_S
from lerobot_env_bimanual.world.scene_view import SceneView


@dataclass(frozen=True)
class Pace:
    """Shares of the arm's own limits, and a speed of the hand.

    Attributes:
        velocity_share: of the joints' velocity limits.
        acceleration_share: of their acceleration limits; also of their jerk limits.
        tip_m_s: greatest speed of the tool centre point.
        tip_m_s2: greatest acceleration of the tool centre point while it gains speed.
    """

    velocity_share: float
    acceleration_share: float
    tip_m_s: float
    tip_m_s2: float = np.inf

    def limits(self, joints: JointLimits) -> MotionLimits:
        """What an arm with these joints may do at this pace."""
        return MotionLimits(
            velocity_rad_s=self.velocity_share * joints.velocity_rad_s,
            acceleration_rad_s2=self.acceleration_share * joints.acceleration_rad_s2,
            # Acceleration is constant within a control tick and steps between two, within one step of physics.
            acceleration_step_rad_s2=self.acceleration_share * joints.jerk_rad_s3 * PHYSICS_STEP_S,
            tip_m_s=self.tip_m_s,
            tip_m_s2=self.tip_m_s2,
        )


FREE = Pace(velocity_share=0.8, acceleration_share=0.5, tip_m_s=1.2)
CONTACT = Pace(velocity_share=0.6, acceleration_share=0.4, tip_m_s=0.5)
"""Pace of grasps, pulls and pushes."""
PUSHING = Pace(velocity_share=0.6, acceleration_share=0.4, tip_m_s=0.5, tip_m_s2=0.5)
"""Pace beside a heavy thing, which the hands have to accelerate to their own speed."""

HEAVY_KG = 20.0
"""Mass from which on a thing takes more force to be set in motion than to be kept in motion."""
BESIDE_M = 0.03
"""Distance from a hand; more than the error of rounded keyposes."""


def is_beside_heavy(scene: SceneView, arm: Arm) -> bool:
    """Whether a hand is within `BESIDE_M` of a free thing of at least `HEAVY_KG`."""
    model, data = scene.model, scene.data
    heavy = [body for body in np.flatnonzero(model.body_subtreemass >= HEAVY_KG) if is_free(model, body)]
    if not heavy:
        return False
    hand = [
        model.body(name).id for name in (scene.arm_pair.hand_body(arm), *scene.arm_pair.finger_names(arm))
    ]
    touchable = (model.geom_contype | model.geom_conaffinity) != 0
    of_hand, of_heavy = (
        np.flatnonzero(np.isin(model.geom_bodyid, bodies) & touchable).tolist() for bodies in (hand, heavy)
    )
    return any(
        mujoco.mj_geomDistance(model, data, one, other, BESIDE_M, None) < BESIDE_M
        for one in of_hand
        for other in of_heavy
    )

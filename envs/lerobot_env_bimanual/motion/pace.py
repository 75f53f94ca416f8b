"""How much of what the arms could do a motion uses."""

from dataclasses import dataclass

import numpy as np

from lerobot_env_bimanual.motion.time_law import MotionLimits
from lerobot_env_bimanual.robots.arm_pair import JointLimits
from lerobot_env_bimanual.world.arena import PHYSICS_STEP_S


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
"""Grasps, pulls and pushes."""
PUSHING = Pace(velocity_share=0.6, acceleration_share=0.4, tip_m_s=0.5, tip_m_s2=0.5)
"""Beside something heavy, which the hands have to bring to their own speed."""

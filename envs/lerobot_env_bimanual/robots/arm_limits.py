"""What the real arm and hand allow, as data; experts' episodes are held against it, and motions may be timed by it.

Joint torques, velocities, accelerations and jerks are the necessary limits of the Franka Control Interface's
documentation for the Franka Emika Robot (Panda). The hand's speed is that of its data sheet.

How hard an arm may push is for its user to choose: libfranka's examples of free motion stop the arm at 20 N
(`setDefaultBehavior`), its examples of impedance and force control, where contact is meant, at 100 N along an axis. Tasks
that squeeze and push mean contact, so whoever ran them on the real arm would choose the latter. It is held
against the length of the whole force.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class ArmLimits:
    """Beyond which a real arm stops, joint by joint (7,), base to wrist.

    Attributes:
        torque_nm: of the motors, gravity included.
        velocity_rad_s: of the commanded joints.
        acceleration_rad_s2: of the commanded joints.
        jerk_rad_s3: of the commanded joints.
        contact_force_n: net force between an arm and all else, as the arm itself would estimate it.
        finger_speed_m_s: of either finger.
    """

    torque_nm: NDArray[np.float64]
    velocity_rad_s: NDArray[np.float64]
    acceleration_rad_s2: NDArray[np.float64]
    jerk_rad_s3: NDArray[np.float64]
    contact_force_n: float
    finger_speed_m_s: float


PANDA_LIMITS = ArmLimits(
    torque_nm=np.array([87.0, 87.0, 87.0, 87.0, 12.0, 12.0, 12.0]),
    velocity_rad_s=np.array([2.175, 2.175, 2.175, 2.175, 2.61, 2.61, 2.61]),
    acceleration_rad_s2=np.array([15.0, 7.5, 10.0, 12.5, 15.0, 20.0, 20.0]),
    jerk_rad_s3=np.array([7500.0, 3750.0, 5000.0, 6250.0, 7500.0, 10000.0, 10000.0]),
    contact_force_n=100.0,
    finger_speed_m_s=0.1,
)

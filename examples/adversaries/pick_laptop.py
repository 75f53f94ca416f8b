"""Pick up the laptop, alone: push it over the holder's edge, go round, take the edge."""

from collections.abc import Iterator

import numpy as np

from adversaries.ways import Way, alone, parameter_grid, rehearsed
from lerobot_bimanual.arms import Arm
from lerobot_bimanual.geometry.pose import Pose
from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.stage import Stage
from lerobot_env_bimanual.tasks import pick_laptop as expert
from lerobot_env_bimanual.world.scene_view import SceneView

BESIDE_M = 0.02
OVERHANG_M = 0.055
HOVER_M = 0.10
FINGER_M = 0.0095
ABOVE_Z_M = 0.935
PUSH_Z_M = 0.865
"""Of pushing and grasping hands: the middle of a voxel, at which the standard holder's laptop lies."""
LIFT_M = 0.08


def ways(env: BimanualEnv, arm: Arm) -> Iterator[Way]:
    """Over any of the four edges, pushed by a hand of either roll, gripped at either roll and several tilts."""
    either, tilts_rad = (1, -1), np.deg2rad((10.0, 30.0))
    chosen = {"tilt_rad": tilts_rad, "quarter": range(4), "roll": either, "side": either}
    return rehearsed(env, parameter_grid(_over_the_edge, arm=[arm], **chosen))


def _over_the_edge(
    scene: SceneView, arm: Arm, quarter: int, tilt_rad: float, roll: int, side: int
) -> Iterator[Stage]:
    """Behind, down, push, up, round, grasp the edge, lift, raise."""
    holder, laptop = scene.pose("holder"), scene.pose("laptop")
    turn = Pose.upright((0, 0, 0), quarter * np.pi / 2)  # its -y is where the laptop goes
    frame = Pose(laptop.position, (laptop @ turn).quat_wxyz)
    half_m = expert.LAPTOP.base_size_m[quarter % 2 == 0] / 2
    holder_half_m = expert.HOLDER.size_m[quarter % 2 == 0] / 2
    # How far the holder extends beyond the laptop on the side of the push.
    gap_m = holder_half_m - half_m - frame.inverse().apply(holder.position)[1]
    push_m = gap_m + OVERHANG_M
    toward, along = frame.rotation[:, 1], frame.rotation[:, 0]

    def pushing(y_m: float, height_m: float) -> Pose:
        x, y, _ = frame.apply((0, y_m, 0))
        return Pose.looking((x, y, height_m), approach=(0, 0, -1), opening=side * along)

    start = half_m + FINGER_M + BESIDE_M
    yield alone(arm, "behind", pushing(start, ABOVE_Z_M), is_open=False, planned=True)
    yield alone(arm, "down", pushing(start, PUSH_Z_M))
    yield alone(arm, "push", pushing(half_m + FINGER_M - push_m, PUSH_Z_M))
    yield alone(arm, "up", pushing(half_m + FINGER_M - push_m + 0.02, ABOVE_Z_M + HOVER_M))
    now = scene.pose("laptop")
    nominal = Pose(frame.position - push_m * toward, frame.quat_wxyz)
    if now.distance_to(laptop)[0] > push_m / 2:  # in a rehearsal nothing is pushed
        nominal = now @ turn

    def gripping(y_m: float, height_m: float) -> Pose:
        x, y, _ = nominal.apply((0, y_m, 0))
        approach = np.cos(tilt_rad) * nominal.rotation[:, 1] - (0, 0, np.sin(tilt_rad))
        return Pose.looking((x, y, height_m), approach=approach, opening=(0, 0, -roll))

    before = gripping(-half_m - 0.10, PUSH_Z_M + 0.01)
    grasp = gripping(-half_m + expert.INSIDE_EDGE_M, PUSH_Z_M)
    yield alone(arm, "before the edge", before, is_open=True, planned=True)
    yield alone(arm, "grasp", grasp, is_open=False, holds="laptop")
    yield alone(arm, "lift", grasp.translated((0, 0, LIFT_M)))
    yield alone(arm, "raise", grasp.translated((0, 0, 0.23)))

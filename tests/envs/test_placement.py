from itertools import product

import numpy as np
import pytest

from lerobot_bimanual.arms import Arm
from lerobot_bimanual.errors import PlacementFailure
from lerobot_env_bimanual.episode.progress import EpisodeProgress
from lerobot_env_bimanual.episode.reset import MAX_DRAWS, EpisodeReset
from lerobot_env_bimanual.gl import mujoco
from lerobot_env_bimanual.task import PlacementArea
from lerobot_env_bimanual.tasks.lift_ball import AREA, LiftBall
from lerobot_env_bimanual.tasks.registry import get_task, list_tasks
from lerobot_env_bimanual.world.scene import Scene

BOX = mujoco.mjtGeom.mjGEOM_BOX
AREA_WITH_YAW = PlacementArea(center_m=(0.2, -0.1), half_size_m=(0.1, 0.3), half_yaw_rad=0.5)


def test_samples_fill_the_area_and_stand_upright():
    rng = np.random.default_rng(0)
    poses = [AREA_WITH_YAW.sample(rng, height_m=0.8) for _ in range(500)]
    rotations = np.array([pose.rotation for pose in poses])
    yaw = np.arctan2(rotations[:, 1, 0], rotations[:, 0, 0])
    offsets = np.column_stack([[pose.position for pose in poses] - np.array((0.2, -0.1, 0.8)), yaw])
    assert np.abs(offsets).max(axis=0) == pytest.approx((0.1, 0.3, 0.0, 0.5), abs=0.01)
    assert (np.abs(offsets) <= (0.1, 0.3, 1e-12, 0.5)).all()
    assert np.allclose(rotations[:, 2, 2], 1)


class BallOutOfReach(LiftBall):
    """Draws legal placements, the first three of which no arm can serve."""

    good_from_draw = 4

    def place(self, scene, variation, rng):
        self.draws_so_far = getattr(self, "draws_so_far", 0) + 1
        super().place(scene, variation, rng)
        if self.draws_so_far < self.good_from_draw:
            scene.place("ball", scene.pose("ball").translated((2.0, 0.0, 0.0)))
        else:
            scene.place("ball", PlacementArea(AREA.center_m, (0.0, 0.0)).sample(rng, 0.9))
        return True


def no_change(task, scene, progress, is_feasible):
    assert scene.ticks == 0


def beginning(task):
    return EpisodeProgress(0, task.spec.variations[0], "", np.random.default_rng(0))


def test_unreachable_placements_are_redrawn_and_counted():
    task = BallOutOfReach()
    scene = Scene(task.spec.props)
    assert EpisodeReset(task, scene, perturb=no_change).start(beginning(task)) == 4
    assert scene.pose("ball").position[:2] == pytest.approx(AREA.center_m, abs=1e-3)
    assert scene.ticks == 0


def test_endless_redrawing_is_an_error_that_counts_the_reasons():
    task = get_task("lift_ball")
    task.place = lambda scene, variation, rng: False
    with pytest.raises(PlacementFailure, match=f"none of {MAX_DRAWS} .*{MAX_DRAWS}x illegal placement"):
        EpisodeReset(task, Scene(task.spec.props), perturb=no_change).start(beginning(task))


@pytest.mark.parametrize("name", [name for name in list_tasks() if name.startswith("handover")])
def test_no_posture_of_the_receiving_arm_touches_what_is_to_be_handed_over(name):
    task, rng = get_task(name), np.random.default_rng(0)
    scene = Scene(task.spec.props)
    base = scene.arm_pair.base_pose(Arm.RIGHT).position
    reach_m = _reach_at_heights(scene, Arm.RIGHT, rng)
    for _ in range(20):
        assert task.place(scene, task.spec.variations[0], rng)
        for prop in task.spec.props:
            half = scene.model.geom(prop.name).size
            pose = scene.pose(prop.name)
            corners = pose.apply(np.array(list(product(*[(-1, 1)] * 3))) * half)
            nearest_m = np.linalg.norm((corners - base)[:, :2], axis=1).min()
            assert nearest_m > reach_m(pose.position[2] + half[2])


def _reach_at_heights(scene, arm, rng):
    """How far from its base an open hand gets along the table at or below a height, over 25 000 stretched postures."""
    kinematics, base = scene.arm_pair.kinematics[arm], scene.arm_pair.base_pose(arm)
    joints = rng.uniform(kinematics.lower, kinematics.upper, (25_000, 7))
    joints[:, [0, 2]], joints[:, 4] = 0.0, rng.choice([0.0, 2.8], len(joints))
    joints[:, 1] = rng.uniform(0.8, kinematics.upper[1], len(joints))
    joints[:, 3] = rng.uniform(-1.0, kinematics.upper[3], len(joints))
    hands, _ = kinematics.poses_and_jacobians(joints)
    points = np.concatenate(
        [hands[:, :3, :3] @ corner + hands[:, :3, 3] for corner in _hand_corners(scene, arm)]
    )
    distance_m, height_m = np.linalg.norm(points[:, :2], axis=1), points[:, 2] + base.position[2]
    return lambda height: distance_m[(height_m >= base.position[2]) & (height_m <= height)].max()


def _hand_corners(scene, arm):
    """Corners (n, 3) of palm and open fingers in the frame of the tool centre point."""
    model, data, to_tcp = scene.model, scene.data, scene.tcp(arm).inverse()
    bodies = [
        model.body(name).id for name in (*scene.arm_pair.finger_names(arm), scene.arm_pair.hand_body(arm))
    ]
    boxes = [g for g in range(model.ngeom) if model.geom_bodyid[g] in bodies and model.geom_type[g] == BOX]
    signs = np.array(list(product(*[(-1, 1)] * 3)))
    world = [
        data.geom_xpos[g] + (signs * model.geom_size[g]) @ data.geom_xmat[g].reshape(3, 3).T for g in boxes
    ]
    return to_tcp.apply(np.concatenate(world))

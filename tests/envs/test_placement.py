import numpy as np
import pytest

from lerobot_bimanual.errors import PlacementFailure
from lerobot_env_bimanual.episode.reset import MAX_DRAWS, EpisodeReset
from lerobot_env_bimanual.placement import PlacementArea
from lerobot_env_bimanual.tasks.lift_ball import AREA, LiftBall
from lerobot_env_bimanual.tasks.registry import get_task
from lerobot_env_bimanual.world.scene import Scene

AREA_WITH_YAW = PlacementArea(center_m=(0.2, -0.1), half_size_m=(0.1, 0.3), half_yaw_rad=0.5)


def test_samples_fill_the_area_and_no_more():
    rng = np.random.default_rng(0)
    poses = [AREA_WITH_YAW.sample(rng, height_m=0.8) for _ in range(500)]
    offsets = np.array([pose.position for pose in poses]) - (0.2, -0.1, 0.8)
    assert np.abs(offsets).max(axis=0) == pytest.approx((0.1, 0.3, 0.0), abs=0.01)
    assert (np.abs(offsets) <= (0.1, 0.3, 1e-12)).all()


def test_samples_stand_upright_and_turn_within_their_range():
    rng = np.random.default_rng(0)
    rotations = np.array([AREA_WITH_YAW.sample(rng, height_m=0.8).rotation for _ in range(500)])
    yaw = np.arctan2(rotations[:, 1, 0], rotations[:, 0, 0])
    assert np.allclose(rotations[:, 2, 2], 1)
    assert np.abs(yaw).max() == pytest.approx(0.5, abs=0.01)
    assert np.abs(yaw).max() <= 0.5


def test_the_generator_alone_decides():
    first, second = (AREA_WITH_YAW.sample(np.random.default_rng(5), 0.8) for _ in range(2))
    assert np.array_equal(first.matrix, second.matrix)


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


def test_unreachable_placements_are_redrawn_and_counted():
    task = BallOutOfReach()
    scene = Scene(task.spec.props)
    assert EpisodeReset(task, scene).start(task.spec.variations[0], np.random.default_rng(0)) == 4
    assert scene.pose("ball").position[:2] == pytest.approx(AREA.center_m, abs=1e-3)
    assert scene.ticks == 0


def test_endless_redrawing_is_an_error_that_counts_the_reasons():
    task = get_task("lift_ball")
    task.place = lambda scene, variation, rng: False
    with pytest.raises(PlacementFailure, match=f"none of {MAX_DRAWS} .*{MAX_DRAWS}x illegal placement"):
        EpisodeReset(task, Scene(task.spec.props)).start(task.spec.variations[0], np.random.default_rng(0))

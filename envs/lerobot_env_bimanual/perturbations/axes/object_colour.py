"""Things are of another colour, unless it is by their colour that they are told apart in words."""

import numpy as np
from numpy.typing import NDArray

from lerobot_bimanual.arms import ARMS
from lerobot_bimanual.geometry.rotations import quat_wxyz_from_axis_angle, quat_wxyz_to_matrix
from lerobot_env_bimanual.episode.reset import EpisodeStart
from lerobot_env_bimanual.perturbations.axes._colour_words import called, named_colours
from lerobot_env_bimanual.perturbations.axis import Axis, Group
from lerobot_env_bimanual.perturbations.registry import register
from lerobot_env_bimanual.world.appearance import Appearance
from lerobot_env_bimanual.world.scene_view import SceneView

TURN_RAD = np.deg2rad(150)
SHIFT = 0.35
"""What is done at magnitude 1: a turn of all hues, and a shift of all colours, in units of a channel."""
DRAWS = 16
"""Of which that one is taken under which the fewest colours stay because they, or what they become, are named."""
UNCOLOURED = (0.5, 0.5, 0.5, 1.0)
"""Of a geom that has the colour of its material."""


@register
class ObjectColour(Axis):
    """One change for all things of an episode: what was of one colour still is, as a rope's end and its plate."""

    name = "object_colour"
    group = Group.SEEN
    levels = (0.25, 0.5, 1.0)
    unit = "share of a turn of all hues by 150 degrees, and of a shift of all colours by 0.35 of a channel"
    summary = "all props get other colours; none that an instruction of the task names is lost or given"
    source = "chosen here: the same things from another shop"

    def look(
        self, start: EpisodeStart, appearance: Appearance, magnitude: float, rng: np.random.Generator
    ) -> Appearance:
        """Draw a change, which spares colours that are named or would come to be."""
        scene, named = start.scene, named_colours(start.task.spec)
        worn = appearance.fields.get("geom_rgba", scene.model.geom_rgba).copy()
        own, of_props = _own_colours(scene, worn), _of_props(scene)
        colours, which = np.unique(own[of_props], axis=0, return_inverse=True)
        draws = [(rng.choice((-1, 1)), _direction(rng)) for _ in range(DRAWS)]
        way, direction = min(draws, key=lambda draw: self._named_by(colours, named, *draw).sum())
        stays = self._named_by(colours, named, way, direction)
        changed = _change(colours, magnitude, way, direction)
        worn[of_props, :3] = np.where(stays[which, None], worn[of_props, :3], changed[which])
        return appearance.wearing(geom_rgba=worn)

    def _named_by(
        self, colours: NDArray, named: set[str], way: float, direction: NDArray
    ) -> NDArray[np.bool_]:
        """Which colours (n, 3) are named now, or would be at any level."""
        at_levels = [colours, *(_change(colours, level, way, direction) for level in self.levels)]
        return np.any([[called(rgb) in named for rgb in level] for level in at_levels], axis=0)


def _direction(rng: np.random.Generator) -> NDArray:
    direction = rng.normal(size=3)
    return direction / np.linalg.norm(direction)


def _change(rgb: NDArray, magnitude: float, way: float, direction: NDArray) -> NDArray:
    """Colours (n, 3) turned about grey and shifted."""
    turn = quat_wxyz_to_matrix(quat_wxyz_from_axis_angle(np.ones(3) / np.sqrt(3), way * magnitude * TURN_RAD))
    return np.clip(rgb @ turn.T + magnitude * SHIFT * direction, 0.02, 1)


def _own_colours(scene: SceneView, worn: NDArray) -> NDArray:
    """(ngeom, 3) of geoms, or of their materials where they have none of their own."""
    model = scene.model
    is_material_s = (worn == UNCOLOURED).all(axis=1) & (model.geom_matid >= 0)
    return np.where(is_material_s[:, None], model.mat_rgba[model.geom_matid], worn)[:, :3]


def _of_props(scene: SceneView) -> NDArray[np.bool_]:
    """(ngeom,) geoms of neither room nor arms."""
    model = scene.model
    others = [0, *(model.body(scene.arm_pair.base_body(arm)).id for arm in ARMS)]
    return ~np.isin(model.body_rootid[model.geom_bodyid], others)

"""What RVT sees: a point cloud, as a whole or zoomed in."""

from dataclasses import dataclass, replace
from typing import Self

from torch import Tensor

from lerobot_policy_bimanual.keypose.observation import Observation
from lerobot_policy_bimanual.rvt_lf.configuration_rvt_lf import RVTLFConfig
from lerobot_policy_bimanual.rvt_lf.point_renderer import render_views
from lerobot_policy_bimanual.rvt_lf.views import magnified, with_mark


@dataclass(frozen=True, eq=False)
class Scene:
    """A point cloud and its views.

    Attributes:
        cloud: the points and their colours.
        config: sizes of the workspace, its views and the points.
        whole: (b, 5, 10, v, v) views of the workspace as made by `render_views`, with a further channel if there is a goal.
        goal: (b, 3) another arm's goal in voxels, which a further channel of all views marks; None for no such channel.
    """

    cloud: Observation
    config: RVTLFConfig
    whole: Tensor
    goal: Tensor | None = None

    @classmethod
    def of(cls, cloud: Observation, config: RVTLFConfig) -> Self:
        """The scene of a cloud."""
        return cls(cloud, config, _views(cloud, config, 1))

    def with_goal(self, place: Tensor) -> Self:
        """The same scene with a mark at places (b, 3) in voxels."""
        return replace(self, whole=with_mark(self.whole, place), goal=place)

    def zoomed_in(self, middle: Tensor) -> Tensor:
        """Views like `whole` of the surroundings of positions (b, 3) in voxels, `fine_stage_zoom` times larger."""
        config, zoom = self.config, self.config.fine_stage_zoom
        middle_m = config.codec.voxel_centers(middle)[..., None]
        center_m = middle_m.new_tensor(config.workspace.center)[:, None]
        points = (self.cloud.points - middle_m) * zoom + center_m
        views = _views(replace(self.cloud, points=points), config, zoom)
        if self.goal is None:
            return views
        return with_mark(views, magnified(self.goal, middle, zoom, config.voxel_size))


def _views(cloud: Observation, config: RVTLFConfig, zoom: int) -> Tensor:
    """Views of a cloud that is magnified already, with points that grow like it."""
    return render_views(
        cloud.points,
        cloud.colours,
        workspace=config.workspace,
        size=config.voxel_size,
        radius=zoom * config.point_radius,
    )

"""A sheet on the table that shows where something is to go."""

from dataclasses import dataclass

from lerobot_env_bimanual.gl import mujoco
from lerobot_env_bimanual.props.prop import add_visual_box

RED = (0.90, 0.10, 0.10, 1.0)
PRINT = (0.99, 0.96, 0.94, 1.0)
PAPER_THICKNESS_M = 0.0005
BORDER_INSET_M = 0.012
BORDER_WIDTH_M = 0.006


@dataclass(frozen=True)
class Target:
    """A static sheet with a printed border; it touches nothing. Its frame lies in its underside's middle.

    Attributes:
        name: body.
        size_m: full sizes along x and y (PerAct2 code).
        rgba: of the sheet.
    """

    name: str = "target"
    size_m: tuple[float, float] = (0.333, 0.198)
    rgba: tuple[float, float, float, float] = RED

    def add_to(self, spec: mujoco.MjSpec) -> None:
        """Write the sheet and the four bars of its border."""
        half_x, half_y = self.size_m[0] / 2, self.size_m[1] / 2
        body = spec.worldbody.add_body(name=self.name)
        self._add_sheet(body, (0, 0), (half_x, half_y), 0.5, self.rgba, name=self.name)
        border_x, border_y = half_x - BORDER_INSET_M, half_y - BORDER_INSET_M
        for side in (-1, 1):
            self._add_sheet(body, (0, side * border_y), (border_x, BORDER_WIDTH_M / 2), 1.0, PRINT)
            self._add_sheet(body, (side * border_x, 0), (BORDER_WIDTH_M / 2, border_y), 1.0, PRINT)

    def _add_sheet(self, body, centre_xy, half_xy, layers: float, rgba, name: str = "") -> None:
        """A thin box lying on the sheet's underside; more `layers` stand prouder."""
        half_z = layers * PAPER_THICKNESS_M
        add_visual_box(body, (*centre_xy, half_z), (*half_xy, half_z), name=name, rgba=rgba)

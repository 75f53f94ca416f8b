"""A push button with a spring under its cap."""

from dataclasses import dataclass
from itertools import product

from lerobot_env_bimanual.gl import mujoco
from lerobot_env_bimanual.props.prop import SLIDE, VISUAL_ONLY, add_box, add_cylinder, add_joint

RED = (0.85, 0.08, 0.08, 1.0)
HIGHLIGHT = (0.95, 0.22, 0.20, 1.0)
COLLAR = (0.20, 0.20, 0.22, 1.0)
STEEL = (0.70, 0.71, 0.73, 1.0)

HALF_SIDE_M = 0.05
BASE_HEIGHT_M = 0.021
CAP_HEIGHT_M = 0.014
CAP_MASS_KG = 0.0685
STROKE_M = CAP_HEIGHT_M
"""Travel until the cap is level with the base, which then stops the finger."""
PLAY_M = 0.0005
STIFFNESS_N_M = 250.0
DAMPING_N_S_M = 6.25
GRAVITY_M_S2 = 9.81

COLLAR_MARGIN_M = 0.004
COLLAR_HALF_HEIGHT_M = 0.0015
SCREW_OFFSET_M = 0.041
SCREW_RADIUS_M = 0.0035


@dataclass(frozen=True)
class Button:
    """A static square base with a red cap that can be pushed into it; its frame lies in the underside's middle.

    Sizes, mass, spring and damper are those of the original (decoded from RLBench's task file).

    Attributes:
        name: body and geom of the base, which carries the button's colour. The cap's body and joint are called
            `<name>_cap`; the joint is 0 m at rest and negative when pressed.
        cap_radius_m: of that cap.
    """

    name: str
    cap_radius_m: float = 0.028

    def add_to(self, spec: mujoco.MjSpec) -> None:
        """Write the base, its trimmings, and the cap on its spring."""
        base = spec.worldbody.add_body(name=self.name)
        half_height = BASE_HEIGHT_M / 2
        add_box(base, (0, 0, half_height), (HALF_SIDE_M, HALF_SIDE_M, half_height), name=self.name)
        self._add_trimmings(base)
        cap = base.add_body(name=f"{self.name}_cap", pos=(0, 0, BASE_HEIGHT_M))
        weight_n = CAP_MASS_KG * GRAVITY_M_S2  # which the spring carries, so that the cap rests at 0
        spring = {"stiffness": STIFFNESS_N_M, "springref": weight_n / STIFFNESS_N_M, "damping": DAMPING_N_S_M}
        add_joint(cap, SLIDE, f"{self.name}_cap", (0, 0, 1), (-STROKE_M, PLAY_M), **spring)
        add_cylinder(
            cap, (0, 0, CAP_HEIGHT_M / 2), self.cap_radius_m, CAP_HEIGHT_M / 2, mass=CAP_MASS_KG, rgba=RED
        )
        top = (0.75 * self.cap_radius_m, COLLAR_HALF_HEIGHT_M / 3)
        add_cylinder(cap, (0, 0, CAP_HEIGHT_M), *top, rgba=HIGHLIGHT, **VISUAL_ONLY)
        spec.add_exclude(bodyname1=self.name, bodyname2=cap.name)  # the cap sinks into the base

    def _add_trimmings(self, base) -> None:
        """A collar around the cap and a screw in each corner."""
        collar = (self.cap_radius_m + COLLAR_MARGIN_M, COLLAR_HALF_HEIGHT_M)
        add_cylinder(base, (0, 0, BASE_HEIGHT_M), *collar, rgba=COLLAR, **VISUAL_ONLY)
        screw = (SCREW_RADIUS_M, COLLAR_HALF_HEIGHT_M / 2)
        for x, y in product((-SCREW_OFFSET_M, SCREW_OFFSET_M), repeat=2):
            add_cylinder(base, (x, y, BASE_HEIGHT_M), *screw, rgba=STEEL, **VISUAL_ONLY)

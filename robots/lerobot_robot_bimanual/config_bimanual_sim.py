"""LeRobot's `--robot.type=bimanual_sim`."""

from dataclasses import dataclass

from lerobot.robots.config import RobotConfig

from lerobot_bimanual.errors import InvalidChoice
from lerobot_env_bimanual.options import EnvOptions, checked_seed

MAX_HOME_TOLERANCE_RAD = 0.05
"""Hands leave home at twice the tolerance; experts' do not come back so far (three episodes of each task and setting)."""


@RobotConfig.register_subclass("bimanual_sim")
@dataclass(kw_only=True)
class BimanualSimConfig(EnvOptions, RobotConfig):
    """Two simulated arms in front of one task, with the options of its environment.

    Raises:
        InvalidChoice: there is no such task; the message lists all.
        BimanualError: another option is outside its choices.
    """

    # Name of the task.
    task: str = "push_box"
    # The default keeps recorded episodes apart from those of evaluations, which are on `test`.
    split: str = "train"
    # Seed of the first episode; every further one has the next.
    seed: int = 0
    # Both hands count as sent home when no joint target is further from it than this; leaders held by hand need about 0.05.
    home_tolerance_rad: float = 1e-3
    # `rgb`, `rgbd` (also depth in millimetres) or `state` (no images).
    obs: str = "rgb"

    def __post_init__(self) -> None:
        """Check everything; LeRobot has a check of its own, but of real cameras. MuJoCo is loaded here."""
        from lerobot_env_bimanual.tasks.registry import get_task

        get_task(self.task).spec.variation_index(self.variation)
        if checked_seed(self.seed) is None:
            raise InvalidChoice("seed", None, "an integer from 0 to 2**63 - 1")
        if not 0 < self.home_tolerance_rad <= MAX_HOME_TOLERANCE_RAD:
            choices = f"a number above 0, at most {MAX_HOME_TOLERANCE_RAD}"
            raise InvalidChoice("home_tolerance_rad", self.home_tolerance_rad, choices)
        EnvOptions.__post_init__(self)
        if self.control_mode == "keypose":
            raise InvalidChoice("control_mode of a robot", self.control_mode, ["auto", "joint"])

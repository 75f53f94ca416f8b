"""A stage of an expert's script: a movement of both arms, and then the grippers."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace

from lerobot_bimanual.arms import ARMS, Arm
from lerobot_bimanual.geometry.pose import Pose
from lerobot_bimanual.keypose import BimanualKeypose, Keypose
from lerobot_env_bimanual.world.scene_view import SceneView


@dataclass(frozen=True)
class Stage:
    """A movement of both arms between two keyposes, followed by the gripper events.

    Attributes:
        name: what happens, for failure reports.
        left: pose of the left tool centre point at the end, world frame; `None` stays where it was sent.
        right: the same of the right arm.
        left_open: state of the left gripper after the movement; `None` keeps it.
        right_open: the same of the right arm.
        planned: move through free space around obstacles; otherwise along straight lines into contact.
        left_holds: the prop that moves with the left hand from the end of this stage on, as far as a
            rehearsal without physics can know; it stays held until the gripper opens.
        right_holds: the same of the right hand.
        turns: a hinge or slide of a prop, and where it is at the end, rad or m; a rehearsal sets it then.
        presses: the prop that the hands press against at the end, and which therefore keeps them from arriving.
    """

    name: str
    left: Pose | None = None
    right: Pose | None = None
    left_open: bool | None = None
    right_open: bool | None = None
    planned: bool = False
    left_holds: str | None = None
    right_holds: str | None = None
    turns: tuple[str, float] | None = None
    presses: str | None = None

    def swapped(self) -> Stage:
        """The stage with each arm in the place of the other."""
        return replace(
            self,
            left=self.right,
            right=self.left,
            left_open=self.right_open,
            right_open=self.left_open,
            left_holds=self.right_holds,
            right_holds=self.left_holds,
        )

    def keypose(self, previous: BimanualKeypose) -> BimanualKeypose:
        """The target of both arms, with what the stage leaves open taken from the `previous` target."""
        return BimanualKeypose(
            left=self._arm_keypose(previous.left, self.left, self.left_open),
            right=self._arm_keypose(previous.right, self.right, self.right_open),
        )

    def _arm_keypose(self, previous: Keypose, pose: Pose | None, is_open: bool | None) -> Keypose:
        return replace(
            previous,
            pose=previous.pose if pose is None else pose,
            gripper_open=previous.gripper_open if is_open is None else is_open,
            ignore_collisions=not self.planned,
        )

    def holds(self, arm: Arm) -> str | None:
        """The prop that `arm` grasps at the end of this stage."""
        return self.left_holds if arm is Arm.LEFT else self.right_holds


def home_keypose(scene: SceneView) -> BimanualKeypose:
    """Where both arms are right after a reset, hands open."""
    left, right = (Keypose(scene.tcp(arm), gripper_open=True, ignore_collisions=True) for arm in ARMS)
    return BimanualKeypose(left, right)


def stages_and_targets(
    script: Callable[[SceneView], Iterable[Stage]], scene: SceneView
) -> Iterator[tuple[Stage, BimanualKeypose]]:
    """The stages of a script in a scene right after its reset, each with the target of both arms."""
    target = home_keypose(scene)
    for stage in script(scene):
        target = stage.keypose(target)
        yield stage, target

"""Rehearses a whole script without physics, to find out whether both arms can do it in a scene.

Scripts read the scene while they run, so a rehearsal hands them a `RehearsalView`: a view with its own state, in which
arms are moved by kinematics and grasped props move rigidly with the hand.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from lerobot_bimanual.arms import ARMS, Arm
from lerobot_bimanual.codec import KeyposeCodec
from lerobot_bimanual.geometry.workspace import VOXEL_WORKSPACE
from lerobot_bimanual.joint_action import by_arm
from lerobot_bimanual.keypose import BimanualKeypose, Keypose
from lerobot_env_bimanual.gl import mujoco
from lerobot_env_bimanual.motion.carrying import Carried
from lerobot_env_bimanual.motion.collision import CollisionChecker, CollisionRules
from lerobot_env_bimanual.motion.feasibility import free_goals, goal_postures, is_at_target
from lerobot_env_bimanual.motion.lines import LineRequest, straight_lines
from lerobot_env_bimanual.stage import Stage
from lerobot_env_bimanual.world.scene_view import SceneView

Array = NDArray[np.floating]
Script = Callable[[SceneView], Iterable[Stage]]
Postures = dict[Arm, Array]

MIN_MARGIN = 0.04
"""Least distance of a joint to its limits at the end of a stage, as a fraction of its range."""
MIN_MARGIN_ROUNDED = 0.03
CHECKED_SHARES = (0.25, 0.5, 0.75)
"""Shares of straight lines at which collisions are checked, too."""


class Rehearsal:
    """Goes through scripts without physics, to find out whether both arms can do them.

    Args:
        scene: the world in which the scripts are to be played. It is read, never changed.
        codecs: a script is rehearsed once for each codec, with its keyposes rounded to the codec's voxels and
            bins; None leaves the keyposes exact.
    """

    def __init__(self, scene: SceneView, codecs: Sequence[KeyposeCodec | None] = (None,)):
        self._scene, self._codecs = scene, codecs
        self._view = RehearsalView(scene)
        self._kinematics = scene.arm_pair.kinematics
        self._checker = CollisionChecker(self._view)
        self._joints: Postures = {}

    def infeasibility(self, script: Script) -> str | None:
        """Why both arms cannot execute a script from the scene's present state.

        Checked at first: no prop in an arm or right beside it. Checked at every stage: targets inside the workspace,
        a collision-free goal for planned stages and feasible straight lines for the others, joint margins, no
        collision of an arm with itself, the table or the other arm.

        Args:
            script: yields the stages when called with a scene, e.g. `lambda view: task.script(view, variation)`.
                It is called with the rehearsal's own scenes, where earlier stages have had their effect.

        Returns:
            None if the script is feasible, else a short reason.
        """
        return next(filter(None, (self._go_through(script, codec) for codec in self._codecs)), None)

    def _go_through(self, script: Script, codec: KeyposeCodec | None) -> str | None:
        """Go from stage to stage; what is infeasible, or None."""
        self._view.copy_from(self._scene)
        commanded = by_arm(self._view.commanded)
        self._joints = {arm: commanded[arm.ordinal, :-1].astype(np.float64) for arm in ARMS}
        if obstacle := self._obstacle(self._checker.standing_rules):
            return f"too close: {obstacle}"
        keypose = self._present_keypose()
        for stage in script(self._view):
            keypose = stage.keypose(keypose)
            if not all(VOXEL_WORKSPACE.contains(keypose[arm].pose.position) for arm in ARMS):
                return f"{stage.name}: target outside the workspace"
            target = keypose if codec is None else codec.discretise(keypose)
            if reason := self._execute(stage, target, MIN_MARGIN if codec is None else MIN_MARGIN_ROUNDED):
                return f"{stage.name}: {reason}"
        return None

    def _present_keypose(self) -> BimanualKeypose:
        """The keypose that keeps everything as it is."""
        openings = by_arm(self._view.commanded)[:, -1]
        targets = [
            Keypose(self._kinematics[arm].pose(self._joints[arm]), bool(openings[arm.ordinal] > 0.5), True)
            for arm in ARMS
        ]
        return BimanualKeypose(*targets)

    def _execute(self, stage: Stage, keypose: BimanualKeypose, min_margin: float) -> str | None:
        """Go to a keypose, or return why not."""
        targets = {arm: keypose[arm].pose.matrix for arm in ARMS}
        moving = {
            arm: target
            for arm, target in targets.items()
            if not is_at_target(self._kinematics[arm], self._joints[arm], target)
        }
        goals = self._free_goals(moving) if stage.planned else self._line_ends(moving)
        if isinstance(goals, str):
            return goals
        for arm, joints in goals.items():
            # The planner starts its next motion from the float32 action that ended this one.
            self._joints[arm] = joints.astype(np.float32).astype(np.float64)
            if self._kinematics[arm].margins(joints).min() < min_margin:
                return f"{arm} arm close to a joint limit"
        self._view.move_arms(goals)
        if stage.turns is not None:
            self._view.turn(*stage.turns)
        for arm in ARMS:
            self._view.set_gripper(arm, keypose[arm].gripper_open, stage.holds(arm))
        obstacle = self._obstacle(self._checker.contact_rules)
        return None if obstacle is None else f"collision of {obstacle}"

    def _obstacle(self, rules: CollisionRules) -> str | None:
        """What is in the way of the arms where they are now."""
        self._checker.update_from_scene()
        return self._checker.obstacle(rules, self._joints[Arm.LEFT], self._joints[Arm.RIGHT])

    def _free_goals(self, targets: Mapping[Arm, Array]) -> Postures | str:
        candidates = {
            arm: goal_postures(self._kinematics[arm], self._joints[arm], target)
            for arm, target in targets.items()
        }
        for arm, postures in candidates.items():
            if not postures:
                return f"{arm} arm out of reach"
        now = self._joints
        self._checker.update_from_scene()
        rules = self._checker.free_motion_rules(targets, self._view.carried, now[Arm.LEFT], now[Arm.RIGHT])
        for goals, obstacle in free_goals(self._checker, rules, now, candidates):
            if obstacle is None:
                return goals
        return "no collision-free posture"

    def _line_ends(self, targets: Mapping[Arm, Array]) -> Postures | str:
        lines = [
            LineRequest(self._kinematics[arm], self._joints[arm], target) for arm, target in targets.items()
        ]
        paths: Postures = {}
        for arm, line in zip(targets, straight_lines(lines), strict=True):
            if line is None:
                return f"{arm} arm cannot follow its line"
            paths[arm] = line
        self._checker.update_from_scene()
        rules = self._checker.contact_rules
        for share in CHECKED_SHARES:
            both = self._joints | {arm: path[round(share * (len(path) - 1))] for arm, path in paths.items()}
            if obstacle := self._checker.obstacle(rules, both[Arm.LEFT], both[Arm.RIGHT]):
                return f"collision of {obstacle} on the way"
        return {arm: path[-1] for arm, path in paths.items()}


class RehearsalView(SceneView):
    """A view with its own state, in which the arms' joints are set directly instead of being driven."""

    def __init__(self, scene: SceneView):
        super().__init__(scene.model, scene.commanded, scene.props, scene.setting)
        self._carried: dict[Arm, tuple[str, Carried]] = {}

    def copy_from(self, scene: SceneView) -> None:
        """Start from another scene's present state."""
        mujoco.mj_resetData(self.model, self.data)
        self.data.qpos[:], self.data.userdata[:] = scene.data.qpos, scene.data.userdata
        self._commanded = scene.commanded
        self._carried.clear()
        self._refresh()

    @property
    def carried(self) -> list[tuple[Arm, str]]:
        """Hand and prop, for all props that move with a hand."""
        return [(arm, prop) for arm, (prop, _) in self._carried.items()]

    def move_arms(self, joints: Postures) -> None:
        """Set the arms' joints, (7,) rad each, and take carried props along."""
        action = by_arm(self._commanded)
        for arm, posture in joints.items():
            self.data.qpos[self.joint_qpos[arm.ordinal]] = posture
            action[arm.ordinal, :-1] = posture
        self._refresh()
        if self._carried:
            for _, carried in self._carried.values():
                carried.follow(self.data)
            self._refresh()

    def turn(self, joint: str, position: float) -> None:
        """Set a hinge or slide of a prop, rad or m."""
        self.data.joint(joint).qpos[:] = position
        self._refresh()

    def set_gripper(self, arm: Arm, is_open: bool, holds: str | None) -> None:
        """Open or close a hand; an open one carries nothing, a closing one takes `holds` along from now on."""
        fingers, travel_m = self._finger_qpos[arm.ordinal], self.arm_pair.finger_travel_m * is_open
        if (self.data.qpos[fingers] != travel_m).any():
            self.data.qpos[fingers] = travel_m
            self._refresh()
        by_arm(self._commanded)[arm.ordinal, -1] = is_open
        if is_open:
            self._carried.pop(arm, None)
        elif holds is not None:
            carried = Carried(self.model, self.data, self.arm_pair.hand_body(arm), holds)
            self._carried[arm] = (holds, carried)

    def _refresh(self) -> None:
        """Recompute what scripts read: where everything is."""
        mujoco.mj_kinematics(self.model, self.data)

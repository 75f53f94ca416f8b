"""Axes that change the arms: `arm_late`, `command_noise`, `grip_force`, `misses`, `start_posture`."""

import numpy as np
from numpy.typing import NDArray

from lerobot_bimanual.arms import ARMS, JOINTS_PER_ARM
from lerobot_bimanual.joint_action import CONTROL_HZ, by_arm
from lerobot_env_bimanual.perturbations.axis import Action, Axis, HookContext, Start, data, register
from lerobot_env_bimanual.world.scene import Scene

DRIFT_PERIOD_S = (4.0, 12.0)
"""Range of the period of a joint's drift; about as long as a task takes."""
MISS_TICKS = 10
"""Ticks after which a miss has its full size; the motion to the first keypose takes longer."""
N_POSTURES = 20
"""Start postures that are drawn; the first that can be used is taken."""


def _delay_arm(context: HookContext[tuple[int, list[Action]]], action: Action) -> Action:
    """Give one arm the action of some ticks ago, or the first one while there is none so old."""
    arm, latest = context.memory or (int(context.rng.integers(len(ARMS))), [action])
    latest = [*latest[-int(context.magnitude) :], action]  # oldest first
    context.remember((arm, latest))
    perturbed_action = action.copy()
    by_arm(perturbed_action)[arm] = by_arm(latest[0])[arm]
    return perturbed_action


register(Axis(**data("arm_late"), command=_delay_arm, late_ticks=int))


type Drift = tuple[NDArray[np.float64], NDArray[np.float64]]
"""Of the arms' joints, each (2, 7): signed share of the level's amplitude, and radians per tick."""


def _draw_drift(start: Start[Drift]) -> None:
    shape = (len(ARMS), JOINTS_PER_ARM)
    share = start.rng.uniform(-1.0, 1.0, shape)
    start.remember((share, 2 * np.pi / (start.rng.uniform(*DRIFT_PERIOD_S, shape) * CONTROL_HZ)))


def _add_drift(context: HookContext[Drift], action: Action) -> Action:
    (share, rad_per_tick), perturbed_action = context.memory, action.copy()
    offsets = share * np.sin(rad_per_tick * context.progress.ticks)
    by_arm(perturbed_action)[:, :-1] += np.deg2rad(context.magnitude) * offsets
    return perturbed_action


register(Axis(**data("command_noise"), begin=_draw_drift, command=_add_drift))


def _weaken_hands(start: Start) -> None:
    """Scale gain, bias and limit of the hands' motors; at rest they pull to the same width."""
    model = start.scene.model
    factors = np.ones((model.nu, 1))
    hands = [model.actuator(start.scene.arm_pair.actuator_names(arm)[-1]).id for arm in ARMS]
    factors[hands] = start.magnitude
    start.scene.alter(
        actuator_gainprm=model.actuator_gainprm * factors,
        actuator_biasprm=model.actuator_biasprm * factors,
        actuator_forcerange=model.actuator_forcerange * factors,
    )


register(Axis(**data("grip_force"), begin=_weaken_hands))


def _draw_miss(start: Start[NDArray[np.float64] | None]) -> None:
    """Draw each joint's share (2, 7) of the level's magnitude."""
    start.remember(start.rng.uniform(-1.0, 1.0, (len(ARMS), JOINTS_PER_ARM)))


def _miss(context: HookContext[NDArray[np.float64] | None], action: Action) -> Action:
    """Shift the joints until the first keypose is over; the planner of the second starts from where they were sent."""
    if context.progress.keyposes:
        context.remember(None)  # attribution of failures sets the counter back
    if context.memory is None:
        return action
    perturbed_action, share = action.copy(), min(1.0, context.progress.ticks / MISS_TICKS)
    by_arm(perturbed_action)[:, :-1] += share * np.deg2rad(context.magnitude) * context.memory
    return perturbed_action


register(Axis(**data("misses"), begin=_draw_miss, command=_miss))


def _draw_posture(start: Start) -> None:
    """Take the first of some drawn postures that touches nothing and is feasible; else stay at home."""
    scene = start.scene
    home = np.array([scene.joint_positions(arm) for arm in ARMS])
    for shares in start.rng.uniform(-1.0, 1.0, (N_POSTURES, len(ARMS), JOINTS_PER_ARM)):
        scene.pose_arms(home + np.deg2rad(start.magnitude) * shares)
        if not _arms_touch(scene) and start.is_feasible():
            return
    scene.pose_arms(home)


def _arms_touch(scene: Scene) -> bool:
    """Whether an arm touches anything, itself included."""
    contact = scene.data.contact
    arms = scene.arm_of_body[scene.model.geom_bodyid[contact.geom.reshape(-1, 2)]]
    return bool(((arms >= 0).any(axis=1) & (contact.dist < 0)).any())


register(Axis(**data("start_posture"), begin=_draw_posture))

"""What an agent that follows an instruction would do in a given scene.

An expert's script serves the variation that its scene was placed for. A control that does not read needs the scripts of
the other instructions in the same scene, as far as what they name is there.
"""

from collections.abc import Callable, Iterator
from functools import partial

import numpy as np

from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.stage import Stage
from lerobot_env_bimanual.task import Task, Variation
from lerobot_env_bimanual.tasks import dual_push_buttons, handover_item
from lerobot_env_bimanual.tasks._handover import hand_over
from lerobot_env_bimanual.world.scene_view import SceneView

type Script = Callable[[SceneView], Iterator[Stage]]


def readings(task: Task, scene: SceneView) -> list[Script]:
    """A script for every instruction that names what is in the scene, in the order of the variations."""
    read = READERS.get(task.spec.name, _of_the_task)
    scripts = [read(task, scene, variation) for variation in task.spec.variations]
    return [script for script in scripts if script is not None]


def chance(task: Task) -> float:
    """Share of a task's episodes that an agent solves that follows a random one of the instructions that the scene allows.

    On average over the variations, in one episode of each.
    """
    env = BimanualEnv(task.spec.name, split="val", obs="state")
    shares = []
    for variation in task.spec.variations:
        env.reset(seed=0, options={"variation": variation.index})
        shares.append(1 / len(readings(task, env.scene)))
    env.close()
    return float(np.mean(shares))


def _of_the_task(task: Task, scene: SceneView, variation: Variation) -> Script:
    return partial(task.script, variation=variation)


def _items(task: Task, scene: SceneView, variation: Variation) -> Script | None:
    """Hand over the item of the named colour, whichever it is."""
    color = handover_item.COLORS[variation.words["color"]]
    named = [item for item in handover_item.ITEMS if _has_color(scene, item, color)]
    left_m, right_m = handover_item.LEFT_BEHIND_M, handover_item.RIGHT_BEHIND_M
    return partial(hand_over, item=named[0], left_behind_m=left_m, right_behind_m=right_m) if named else None


def _buttons(task: Task, scene: SceneView, variation: Variation) -> Script | None:
    """Push the buttons of the two named colours, if both are there, each with the hand on whose side it lies."""
    asked_for = [dual_push_buttons.COLORS[variation.words[word]] for word in dual_push_buttons.WORDS[:2]]
    buttons = (dual_push_buttons.RIGHT, dual_push_buttons.LEFT, dual_push_buttons.OTHER)
    named = [button for button in buttons if any(_has_color(scene, button, color) for color in asked_for)]
    if len(named) < len(asked_for):
        return None
    right, left = sorted(named, key=lambda button: scene.pose(button).position[1])
    return partial(dual_push_buttons.press, left_button=left, right_button=right)


def _has_color(scene: SceneView, geom: str, rgba: tuple[float, ...]) -> bool:
    return bool(np.allclose(scene.model.geom(geom).rgba, rgba))


READERS = {"handover_item": _items, "dual_push_buttons": _buttons}
"""Tasks whose scripts take for granted that the scene was placed for their variation."""

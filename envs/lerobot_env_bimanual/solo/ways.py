"""What a one-arm adversary may do, and where its scripts are found.

A way is a script like an expert's, but for one arm; the other one stays where it is, its hand open. A task may be tried
in several ways. An adversary looks at the scene, so its module offers ways best first; a few of those that can be rehearsed
are tried in a copy of the episode, and the first that succeeds there is played.
"""

import functools
import importlib
import importlib.util
from collections.abc import Callable, Iterator

from lerobot_bimanual.arms import Arm
from lerobot_bimanual.errors import BimanualError
from lerobot_bimanual.geometry.pose import Pose
from lerobot_env_bimanual.stage import Stage
from lerobot_env_bimanual.task import Variation
from lerobot_env_bimanual.world.scene_view import SceneView

type Way = Callable[[SceneView], Iterator[Stage]]
type Ways = Callable[[SceneView, Variation, Arm], Iterator[Way]]


@functools.cache
def find_ways(task: str) -> Ways:
    """The function `ways` of the module that bears the task's name.

    Raises:
        BimanualError: there is no such module, so nobody knows how far one arm gets.
    """
    module = f"{__package__}.{task}"
    if importlib.util.find_spec(module) is None:
        raise BimanualError(
            f"nobody has written down how one arm would try {task!r}: {module} does not exist"
        )
    return importlib.import_module(module).ways


def alone(
    arm: Arm,
    name: str,
    pose: Pose | None = None,
    is_open: bool | None = None,
    planned: bool = False,
    holds: str | None = None,
) -> Stage:
    """A stage of one arm; the arguments are those of `Stage`."""
    own = {arm.value: pose, f"{arm.value}_open": is_open, f"{arm.value}_holds": holds}
    return Stage(name, planned=planned, **own)

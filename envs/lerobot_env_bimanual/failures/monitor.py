"""What happens in an episode while it is played: facts of physics and of commands, without a verdict."""

from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, fields, replace

import numpy as np
from numpy.typing import NDArray

from lerobot_bimanual.arms import ARMS, Arm
from lerobot_bimanual.joint_action import by_arm
from lerobot_env_bimanual.conditions import Condition, check
from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.experts.load import LoadMeter
from lerobot_env_bimanual.task import Task, Variation

MIN_TICKS = 5
"""A quarter of a second: a shorter contact may be a bounce or a flicker, and is not counted."""
DROP_M = 0.06
"""The item drops 4 cm when the expert of put_item_in_drawer lets it go into its drawer."""
DROP_TICKS = 10
"""In half a second a body falls 1.2 m if nothing is below it."""


@dataclass(frozen=True)
class EpisodeEvents:
    """Events of an episode.

    Attributes:
        failure: why the environment ended it; empty after a success, or when time ended it.
        unstable: whether MuJoCo warned.
        contact_force_n: largest force in N between an arm and everything else, filtered as in the load metrics.
        gripped: hands, and the bodies that each held for `MIN_TICKS`.
        touched: bodies that any hand touched.
        closed: hands that were told to close for `MIN_TICKS`, and the tick at which they first were.
        lost: bodies that were held for `MIN_TICKS` and then slipped out of a hand that was told to stay closed, or were
            let go and fell by `DROP_M` within `DROP_TICKS`; and the tick from which no hand held them.
        unmet: names of the conditions of success that never held, or that had to hold all the time and did not.
        met_together: whether all conditions of success held at the same tick.
        others_met: conditions of other variations that did not hold at the start and held for `MIN_TICKS`.
    """

    failure: str
    unstable: bool
    contact_force_n: float
    gripped: frozenset[tuple[Arm, str]]
    touched: frozenset[str]
    closed: dict[Arm, int]
    lost: dict[str, int]
    unmet: tuple[str, ...]
    met_together: bool
    others_met: frozenset[str]


class EpisodeMonitor:
    """Observes one episode, from its reset on, without changing it by a bit: as `env.observed_by(note, note_step)`."""

    def __init__(self, env: BimanualEnv):
        self._env = env
        task, variation = env.task_definition, env.progress.variation
        self._conditions = task.conditions(variation)
        self._others = [other for other in other_conditions(task, variation) if not other(env.scene)]
        self._load = LoadMeter(env.scene)
        self.note_step = self._load.observe_step
        scene = env.scene
        part, root = scene.model.body_weldid, scene.model.body_rootid
        # Free bodies as a whole, and each moving part of furniture.
        movable = np.where(part[root] != 0, root, part)
        self._body_of_geom = np.where(scene.arm_of_body < 0, movable, 0)[scene.model.geom_bodyid]
        self._gripped: _Runs[tuple[Arm, str]] = _Runs()
        self._touched: set[str] = set()
        self._closed: _Runs[Arm] = _Runs()
        self._carried: dict[str, _Carried] = {}
        self._lost: dict[str, int] = {}
        self._met: set[str] = set()
        self._met_together = False
        self._others_met: _Runs[str] = _Runs()

    def note(self, env: BimanualEnv, joint_action: NDArray[np.float32]) -> None:
        """Note the state before a tick, and its joint action (16,)."""
        self._load.observe_tick()
        self._observe()

    def events(self) -> EpisodeEvents:
        """The events, after the episode has ended."""
        self._observe()
        progress = self._env.progress
        return EpisodeEvents(
            failure=progress.failure,
            unstable=self._env.scene.unstable,
            contact_force_n=self._load.result().contact_force_n if progress.ticks else 0.0,
            gripped=frozenset(self._gripped.lasting),
            touched=frozenset(self._touched),
            closed=self._closed.lasting,
            lost=self._lost,
            unmet=tuple(
                one.name
                for one in self._conditions
                if not progress.history_conditions.get(one.name, one.name in self._met)
            ),
            met_together=self._met_together,
            others_met=frozenset(self._others_met.lasting),
        )

    def _observe(self) -> None:
        scene, tick = self._env.scene, self._env.progress.ticks
        # All conditions, whereas the environment stops at the first that is not met.
        now = check(self._conditions, scene, self._env.progress.history_conditions)
        met = {name for name, is_met in now.items() if is_met}
        self._met |= met
        self._met_together |= len(met) == len(self._conditions)
        self._others_met.note(tick, (other.name for other in self._others if other(scene)))
        closed = {arm for arm in ARMS if by_arm(scene.commanded)[arm.ordinal, -1] < 0.5}
        self._closed.note(tick, closed)
        self._touched.update(*(self._in_contact(scene.arm_pair.hand_body(arm)) for arm in ARMS))
        held = {arm: self._held(arm) for arm in ARMS}
        self._gripped.note(tick, ((arm, body) for arm in ARMS for body in held[arm]))
        self._follow(held, closed)

    def _held(self, arm: Arm) -> set[str]:
        """Names of the bodies that a hand grips, as `SceneView.held` defines it."""
        scene = self._env.scene
        if not scene.grips(arm):
            return set()
        return set.intersection(*map(self._in_contact, scene.arm_pair.finger_names(arm)))

    def _in_contact(self, part: str) -> set[str]:
        """Names of the movable bodies that a part of an arm touches."""
        scene = self._env.scene
        pairs = scene.data.contact.geom.reshape(-1, 2)
        own = scene.geoms(part)[pairs]
        bodies = np.unique(self._body_of_geom[pairs[own[:, ::-1]]])
        return {scene.model.body(body).name for body in bodies if body}

    def _follow(self, held: dict[Arm, set[str]], closed: set[Arm]) -> None:
        """Follow the bodies that hands carry, and note those that they lose."""
        for body in set.union(*held.values()) - set(self._carried):
            self._carried[body] = _Carried()
        for body, carried in self._carried.items():
            hands = {arm for arm in ARMS if body in held[arm]}
            height_m = float(self._env.scene.pose(body).position[2])
            if hands:
                is_new = carried.ticks_since and carried.ticks < MIN_TICKS
                carried.ticks = 1 if is_new else carried.ticks + 1
                carried.hands, carried.height_m, carried.ticks_since = hands, height_m, 0
                continue
            carried.ticks_since += 1
            slipped = carried.ticks_since == MIN_TICKS and bool(carried.hands & closed)
            fell = carried.ticks_since <= DROP_TICKS and carried.height_m - height_m >= DROP_M
            if carried.ticks >= MIN_TICKS and (slipped or fell):
                self._lost.setdefault(body, self._env.progress.ticks - carried.ticks_since + 1)


class _Runs[Key]:
    """Facts that hold for several ticks in a row.

    Attributes:
        lasting: facts that held for `MIN_TICKS`, and the tick at which each first began to.
    """

    def __init__(self):
        self.lasting: dict[Key, int] = {}
        self._ticks: Counter[Key] = Counter()

    def note(self, tick: int, now: Iterable[Key]) -> None:
        """Note the facts that hold at a tick."""
        self._ticks = Counter({key: self._ticks[key] + 1 for key in now})
        for key, ticks in self._ticks.items():
            if ticks == MIN_TICKS:
                self.lasting.setdefault(key, tick - ticks + 1)


@dataclass
class _Carried:
    """A body that was held: the hands that held it last, its height then, for how many ticks, and how many ago."""

    hands: set[Arm] = field(default_factory=set)
    height_m: float = 0.0
    ticks: int = 0
    ticks_since: int = 0


def other_conditions(task: Task, variation: Variation) -> Iterator[Condition]:
    """Conditions of other variations than this one, and its own with another prop of the same kind."""
    own = set(task.conditions(variation))
    kinds = {prop.name: type(prop) for prop in task.spec.props}
    others = {condition: None for row in task.spec.variations for condition in task.conditions(row)}
    for condition in own:
        named = {field.name: getattr(condition, field.name) for field in fields(condition)}
        for name, prop in named.items():
            if isinstance(prop, str) and prop in kinds:
                alike = [other for other, kind in kinds.items() if kind is kinds[prop] and other != prop]
                others |= {replace(condition, **{name: other}): None for other in alike}
    yield from sorted((other for other in others if other not in own), key=lambda other: other.name)

"""What a witness can say of an episode that is played before its eyes: facts of physics and commands, no verdicts."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.typing import NDArray

from lerobot_bimanual.arms import ARMS, Arm
from lerobot_bimanual.joint_action import by_arm
from lerobot_env_bimanual.conditions import Condition
from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.experts.load import LoadMeter
from lerobot_env_bimanual.task import Task, Variation
from lerobot_env_bimanual.world.contacts import ContactQueries

SURE_TICKS = 5
"""A quarter of a second: what lasts so long was no bounce, no flicker of a contact."""
FALL_M = 0.06
"""The item falls 4 cm when the expert of put_item_in_drawer lets it go into its drawer."""
FALL_TICKS = 10
"""In half a second a thing falls 1.2 m if nothing is below it."""


@dataclass(frozen=True)
class EpisodeFacts:
    """What happened in an episode.

    Attributes:
        failure: what the environment says ended it; empty if time did, or success.
        unstable: whether MuJoCo warned.
        contact_force_n: largest force between an arm and all else, through the low pass of `experts.load`.
        gripped: hands, and what each held for `SURE_TICKS`.
        touched: what any hand touched.
        closed: hands that were told to close for `SURE_TICKS`, and the tick at which they first were.
        lost: what was held for `SURE_TICKS` and then slipped out of a hand that was told to stay closed, or was let go
            and fell by `FALL_M` within `FALL_TICKS`; and the tick at which no hand held it any more.
        met: names of the conditions of success that held at some tick.
        unmet: names of the others.
        met_together: whether all held at the same tick.
        others_met: conditions that are none of this episode's, did not hold at its start, and held for `SURE_TICKS`.
    """

    failure: str
    unstable: bool
    contact_force_n: float
    gripped: frozenset[tuple[Arm, str]]
    touched: frozenset[str]
    closed: dict[Arm, int]
    lost: dict[str, int]
    met: tuple[str, ...]
    unmet: tuple[str, ...]
    met_together: bool
    others_met: frozenset[str]


class EpisodeWitness:
    """Watches one episode, which goes on bit for bit as without it.

    Args:
        env: right after its reset; it has to be `observed_by` the methods `note` and `note_step`.
    """

    def __init__(self, env: BimanualEnv):
        self._env = env
        task, variation = env.task_definition, env.progress.variation
        self._conditions = task.conditions(variation)
        self._others = [other for other in other_conditions(task, variation) if not other(env.scene)]
        self._load = LoadMeter(env.scene)
        self._things = _Things(env)
        self._gripped: Counter[tuple[Arm, str]] = Counter()
        self._touched: set[str] = set()
        self._closed: Counter[Arm] = Counter()
        self._first_closed: dict[Arm, int] = {}
        self._carried: dict[str, _Carried] = {}
        self._lost: dict[str, int] = {}
        self._met: set[str] = set()
        self._met_together = False
        self._others_met: Counter[str] = Counter()

    def note(self, env: BimanualEnv, joint_action: NDArray[np.float32]) -> None:
        """Note the state before a tick, and its action."""
        self._load.observe_tick(joint_action)
        self._look()

    def note_step(self) -> None:
        """Note a step of physics."""
        self._load.observe_step()

    def facts(self) -> EpisodeFacts:
        """The facts, after the episode has ended."""
        self._look()
        progress = self._env.progress
        names = [condition.name for condition in self._conditions]
        return EpisodeFacts(
            failure=progress.failure,
            unstable=self._env.scene.unstable,
            contact_force_n=self._load.result().contact_force_n if progress.ticks else 0.0,
            gripped=frozenset(_sure(self._gripped)),
            touched=frozenset(self._touched),
            closed={arm: self._first_closed[arm] for arm in _sure(self._closed)},
            lost=self._lost,
            met=tuple(name for name in names if name in self._met),
            unmet=tuple(name for name in names if name not in self._met),
            met_together=self._met_together,
            others_met=frozenset(_sure(self._others_met)),
        )

    def _look(self) -> None:
        scene = self._env.scene
        # All of them, while the environment stops at the first that is not met.
        met = {condition.name for condition in self._conditions if condition(scene)}
        self._met |= met
        self._met_together |= len(met) == len(self._conditions)
        self._others_met.update(other.name for other in self._others if other(scene))
        closed = {arm for arm in ARMS if by_arm(scene.commanded)[arm.ordinal, -1] < 0.5}
        self._closed.update(closed)
        self._first_closed = dict.fromkeys(closed, self._env.progress.ticks) | self._first_closed
        self._touched.update(*(self._things.touched(arm) for arm in ARMS))
        held = {arm: self._things.held(arm) for arm in ARMS}
        self._gripped.update((arm, thing) for arm in ARMS for thing in held[arm])
        self._follow(held, closed)

    def _follow(self, held: dict[Arm, set[str]], closed: set[Arm]) -> None:
        """Follow what hands carry, and notice what they lose."""
        for thing in set.union(*held.values()) - set(self._carried):
            self._carried[thing] = _Carried()
        for thing, carried in self._carried.items():
            hands = {arm for arm in ARMS if thing in held[arm]}
            height_m = float(self._env.scene.pose(thing).position[2])
            if hands:
                carried.hands, carried.height_m, carried.away_ticks = hands, height_m, 0
                carried.ticks += 1
                continue
            carried.away_ticks += 1
            slipped = carried.away_ticks == SURE_TICKS and bool(carried.hands & closed)
            fell = carried.away_ticks <= FALL_TICKS and carried.height_m - height_m >= FALL_M
            if carried.ticks >= SURE_TICKS and (slipped or fell):
                self._lost.setdefault(thing, self._env.progress.ticks - carried.away_ticks + 1)


@dataclass
class _Carried:
    """Something that a hand has held.

    Attributes:
        hands: that held it last.
        height_m: where it was then.
        ticks: for which it was held.
        away_ticks: since then.
    """

    hands: set[Arm] | frozenset[Arm] = frozenset()
    height_m: float = 0.0
    ticks: int = 0
    away_ticks: int = 0


class _Things:
    """What can be moved in a scene: each thing that lies free, as a whole, and each moving part of furniture."""

    def __init__(self, env: BimanualEnv):
        self._scene = scene = env.scene
        model, pair = scene.model, scene.arm_pair
        contacts = ContactQueries(model, scene.data)
        part, root = model.body_weldid, model.body_rootid
        thing = np.where(part[root] != 0, root, part)
        self._thing_of_geom = thing[model.geom_bodyid]
        for arm in ARMS:
            self._thing_of_geom[contacts.geoms(pair.base_body(arm))] = 0
        self._hands = {arm: contacts.geoms(pair.hand_body(arm)) for arm in ARMS}
        self._fingers = {arm: [contacts.geoms(finger) for finger in pair.finger_names(arm)] for arm in ARMS}

    def touched(self, arm: Arm) -> set[str]:
        """Names of the bodies that the hand touches."""
        return self._beside(self._hands[arm])

    def held(self, arm: Arm) -> set[str]:
        """Names of the bodies that it grips, as `SceneView.held` has it."""
        if not self._scene.grips(arm):
            return set()
        return set.intersection(*map(self._beside, self._fingers[arm]))

    def _beside(self, geoms: NDArray[np.bool_]) -> set[str]:
        pairs = self._scene.data.contact.geom.reshape(-1, 2)
        mine = geoms[pairs]
        things = np.unique(self._thing_of_geom[pairs[mine[:, ::-1]]])
        return {self._scene.model.body(thing).name for thing in things if thing}


def other_conditions(task: Task, variation: Variation) -> Iterator[Condition]:
    """Conditions of other variations that are none of this one's, and this one's said of another prop of the same kind.

    Args:
        task: whose conditions.
        variation: the one that is asked for.
    """
    own = set(task.conditions(variation))
    kinds = {prop.name: type(prop) for prop in task.spec.props}
    others = {condition: None for row in task.spec.variations for condition in task.conditions(row)}
    for condition in own:
        named = {field.name: getattr(condition, field.name) for field in fields(condition)}
        for field, prop in named.items():
            if isinstance(prop, str) and prop in kinds:
                alike = [name for name, kind in kinds.items() if kind is kinds[prop] and name != prop]
                others |= {replace(condition, **{field: name}): None for name in alike}
    yield from sorted((other for other in others if other not in own), key=lambda other: other.name)


def _sure[Key](counts: Counter[Key]) -> Iterator[Key]:
    return (key for key, ticks in counts.items() if ticks >= SURE_TICKS)

"""The engine of all sweeps: a pool of processes that plays episodes and keeps each outcome as soon as it is there.

Workers import neither LeRobot nor torch and render nothing. An outcome depends on its spec alone, so any number of
workers gives the same list, and outcomes that a log already holds are not played again.
"""

import hashlib
import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from functools import lru_cache
from importlib.util import find_spec
from itertools import islice
from pathlib import Path

from lerobot_bimanual.codec import KeyposeCodec
from lerobot_bimanual.errors import BimanualError, PlacementFailure
from lerobot_bimanual.results.expert_report import EXPERTS, EpisodeOutcome, PlayerName
from lerobot_bimanual.results.journal import Journal
from lerobot_bimanual.results.record import Record
from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.experts.baselines import make_player, mean_of_episodes
from lerobot_env_bimanual.experts.load import ReplayMode, run_measured
from lerobot_env_bimanual.experts.runner import outcome_of, run_episode
from lerobot_env_bimanual.experts.world_version import simulation_versions
from lerobot_env_bimanual.options import STANDARD
from lerobot_env_bimanual.registry import AXES
from lerobot_env_bimanual.tasks.registry import TASKS
from lerobot_env_bimanual.workers import WorkerPool

MEAN_EPISODES = 30
"""Training episodes whose mean keyposes the open-loop baseline plays."""
MAX_SHOWN = 3
"""Accidents that an error names."""

type Keyposes = tuple[tuple[float, ...], ...]
"""Keyposes (18,) each."""


@dataclass(frozen=True)
class EpisodeSpec:
    """One episode; its outcome depends on these fields alone, of which several are options of the environment.

    Attributes:
        player: name of the player.
        discretise: voxels per axis to which an expert's keyposes are rounded; 0 leaves them exact.
        mean_keyposes: keyposes of the player `open_loop`.
        replay: how a solved episode of an expert is replayed afterwards.
        plan: number of the plan of the player `expert`.
    """

    task: str
    variation: str
    split: str
    seed: int
    player: PlayerName
    discretise: int = 0
    mean_keyposes: Keyposes = ()
    replay: ReplayMode = "none"
    perturb: str = ""
    setting: str = STANDARD
    plan: int = 0

    def __str__(self) -> str:
        place = f"{self.task} at {self.perturb}" if self.perturb else self.task
        return f"{self.player} on seed {self.seed} of {place}"


@lru_cache(maxsize=1)
def _environment(task: str, variation: str, split: str, perturb: str, setting: str) -> BimanualEnv:
    """The environment of the last episode of this process, kept for the next one of its kind."""
    return BimanualEnv(task, obs="state", variation=variation, split=split, perturb=perturb, setting=setting)


def play(spec: EpisodeSpec) -> EpisodeOutcome:
    """Play one episode in this process."""
    env = _environment(spec.task, spec.variation, spec.split, spec.perturb, spec.setting)
    codec = KeyposeCodec(voxels=spec.discretise) if spec.discretise else None
    player = make_player(spec.player, spec.seed, codec, spec.mean_keyposes, spec.plan)
    try:
        if spec.player in EXPERTS:
            return run_measured(env, spec.seed, player, spec.replay)
        return run_episode(env, spec.seed, player)
    except PlacementFailure as failure:
        return outcome_of(env, success=False, failure=str(failure))
    except Exception:
        _environment.cache_clear()  # its state is unknown
        raise


class _Line(Record):
    """One line of a log: SHA-256 of the code and an episode's spec, and its outcome."""

    spec: str
    outcome: EpisodeOutcome


class EpisodeLog(Journal[_Line]):
    """A file with one line per finished episode, written as they finish.

    Lines of other code or other versions are discarded, and so are damaged ones, as of a last line that was cut off:
    their episodes are played again.

    Arguments and errors are those of `Journal`.
    """

    def __init__(self, path: Path, *, exclusive: bool = False):
        self._code = json.dumps(simulation_versions() | {"sources": _source_digest()}, sort_keys=True)
        super().__init__(path, _Line, exclusive=exclusive)
        if self.header != self._code:
            self.restart(self._code)
        self._outcomes = {line.spec: line.outcome for line in self.entries()}

    def get(self, spec: EpisodeSpec) -> EpisodeOutcome | None:
        """The outcome of an episode, if it is known."""
        return self._outcomes.get(self._key(spec))

    def keep(self, spec: EpisodeSpec, outcome: EpisodeOutcome) -> None:
        """Keep an outcome."""
        key = self._key(spec)
        self.add(_Line(spec=key, outcome=outcome))
        self._outcomes[key] = outcome

    def _key(self, spec: EpisodeSpec) -> str:
        """Key of a spec and the code: after an edit, a process of the old code may still add lines to the new log."""
        return hashlib.sha256((self._code + json.dumps(asdict(spec), sort_keys=True)).encode()).hexdigest()


def _source_digest() -> str:
    """SHA-256 of all code and data that decides the outcome of an episode, which may change while a sweep is interrupted.

    That is this project's packages, and the package or file of every other task and axis.
    """
    modules = (*TASKS.modules.values(), *AXES.modules.values())
    digest = hashlib.sha256()
    for name in sorted({"lerobot_bimanual", *(module.partition(".")[0] for module in modules)}):
        spec = find_spec(name)
        if spec is None or spec.origin is None:
            continue  # playing the task reports that it cannot be imported
        origin = Path(spec.origin)
        files = [origin]
        if spec.submodule_search_locations:
            files = sorted(path for path in origin.parent.rglob("*") if path.suffix in (".py", ".toml"))
        for path in files:
            digest.update(f"{name}/{path.relative_to(origin.parent)}".encode() + path.read_bytes())
    return digest.hexdigest()


class Evaluator(WorkerPool):
    """A pool of worker processes that plays episodes and keeps outcomes in a log; use it in a `with` statement."""

    def __init__(self, workers: int, log: EpisodeLog | None = None):
        super().__init__(workers)
        self._log = log
        self._mean_keyposes: dict[tuple[str, str, str], Keyposes] = {}

    def __exit__(self, *error: object) -> None:
        """End the processes, and close the log."""
        super().__exit__(*error)
        if self._log is not None:
            self._log.close()

    def play(self, specs: Sequence[EpisodeSpec], label: str) -> list[EpisodeOutcome]:
        """Outcomes of episodes, in their order, with a progress bar called `label`.

        Raises:
            BimanualError: an episode could not be played, as when its process died. All others are played, and kept in the
                log, before it is raised.
        """
        known = {spec: outcome for spec in specs if self._log and (outcome := self._log.get(spec))}
        missing = [spec for spec in specs if spec not in known]
        accidents: dict[EpisodeSpec, str] = {}

        def note(spec: EpisodeSpec, outcome: EpisodeOutcome | str) -> None:
            if isinstance(outcome, str):
                accidents[spec] = outcome
                return
            known[spec] = outcome
            if self._log:
                self._log.keep(spec, outcome)

        for _ in self.map(
            play, missing, label, "episode", len(known), failed=lambda _, reason: reason, note=note
        ):
            pass  # `note` keeps each outcome at once, also one behind an episode that takes long
        if accidents:
            reasons = "; ".join(f"{spec}: {reason}" for spec, reason in islice(accidents.items(), MAX_SHOWN))
            raise BimanualError(
                f"{len(accidents)} of {len(specs)} episodes were not played ({reasons}); the same command tries again"
            )
        return [known[spec] for spec in specs]

    def mean_keyposes(self, task: str, variation: str, setting: str = STANDARD) -> Keyposes:
        """Mean keyposes of the expert's training episodes of one variation, which are played once.

        Raises:
            BimanualError: the expert solved none of them.
        """
        if (task, variation, setting) not in self._mean_keyposes:
            spec = EpisodeSpec(task, variation, "train", 0, "expert", setting=setting)
            specs = [replace(spec, seed=seed) for seed in range(MEAN_EPISODES)]
            outcomes = self.play(specs, f"{task}: training episodes")
            episodes = [outcome.commands for outcome in outcomes if outcome.success]
            if not episodes:
                raise BimanualError(f"the expert of {task!r} solves no training episode: there is no mean")
            mean = mean_of_episodes(episodes).tolist()
            self._mean_keyposes[task, variation, setting] = tuple(map(tuple, mean))
        return self._mean_keyposes[task, variation, setting]

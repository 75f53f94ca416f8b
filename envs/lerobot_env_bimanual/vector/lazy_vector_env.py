"""Vector environments for evaluation: started at their first use, quick to start, idle after their episode.

LeRobot has such a vector environment, but importing it costs every worker process about eight seconds for
LeRobot and torch. This module and all that a worker needs import neither.
"""

import contextlib
import multiprocessing
import sys
import threading
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from multiprocessing import connection
from multiprocessing.process import BaseProcess
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.vector import AsyncVectorEnv, AutoresetMode, SyncVectorEnv, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from lerobot_bimanual.errors import InvalidAction, InvalidChoice
from lerobot_bimanual.joint_action import CONTROL_HZ
from lerobot_bimanual.keypose_layout import KEYPOSE_DIM
from lerobot_bimanual.results.episode import Episode
from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.options import checked_reset_options, checked_seed
from lerobot_env_bimanual.vector.episode_recorder import EpisodeRecorder
from lerobot_env_bimanual.vector.evaluation import Evaluation, EvaluationLog
from lerobot_env_bimanual.vector.hold_after_done import HoldAfterDone, SkippedEpisode
from lerobot_env_bimanual.workers import (
    WorkerDied,
    as_picklable_error,
    clear_errors_of_start,
    end_with_parent,
    ensure_fork_server,
    exit_reason,
)

PRELOADED_IN_FORK_SERVER = ["lerobot_env_bimanual.workers", "lerobot_env_bimanual.env"]
"""Imported once by the process from which the workers are forked, instead of by each of them."""

KEYPOSE_FPS = 2
"""Frame rate of LeRobot's own videos of keypose policies, which hold one frame per keypose."""

TIMEOUT_S = 5.0
"""The system says within this time which process has died."""

_main_module_lock = threading.Lock()


class WrappedError(Exception):
    """Carries an error out of a worker: Gymnasium makes errors anew from their message, ours take other arguments."""

    @property
    def error(self) -> Exception:
        """What was raised."""
        error = self.args[0]
        return error.error if isinstance(error, WrappedError) else error


class _InWorker(gym.Wrapper):
    """Carries every error of a reset or a step out of the worker."""

    def reset(self, **arguments: Any) -> tuple[Any, dict[str, Any]]:
        with self._wrap_errors():
            return self.env.reset(**arguments)

    def step(self, action: Any) -> tuple[Any, Any, bool, bool, dict[str, Any]]:
        with self._wrap_errors():
            return self.env.step(action)

    @contextlib.contextmanager
    def _wrap_errors(self) -> Iterator[None]:
        try:
            yield
        except gym.error.Error:
            raise
        except Exception as error:
            raise WrappedError(as_picklable_error(error)) from error


def _make(make_env: Callable[[], BimanualEnv], recorded: bool, in_worker: bool) -> gym.Env:
    if in_worker:
        end_with_parent()
    env = make_env()
    held = HoldAfterDone(EpisodeRecorder(env) if recorded else env)
    return _InWorker(held) if in_worker else held


@contextlib.contextmanager
def _main_module_hidden() -> Iterator[None]:
    """Keep `multiprocessing` from importing the main script again in every worker.

    Workers need nothing from it, and the scripts `lerobot-eval` and `lerobot-train` would bring LeRobot and
    torch along. The standard library offers no switch for this, it only skips a main module without a file.
    """
    main = sys.modules["__main__"]
    with _main_module_lock:
        file, spec = main.__dict__.pop("__file__", None), main.__spec__
        main.__spec__ = None
        try:
            yield
        finally:
            main.__spec__ = spec
            if file is not None:
                main.__file__ = file


class LazyVectorEnv(VectorEnv):
    """A synchronous or asynchronous vector environment that exists from its first use until `close`.

    LeRobot creates the vector environments of all tasks at once and evaluates them one after the other; this
    way only one task's environments hold processes and memory. It can be used again after `close`. Automatic
    resets happen at the step after an episode's end and change nothing, see `HoldAfterDone`.

    With `results_dir`, an episode that was played before is not played again: it ends after one step, with its
    recorded success. So LeRobot's loop continues where it was interrupted, and its summary covers all episodes.

    An action that cannot be executed, such as a NaN, ends the episode of its own environment as a failure; the others go on.
    If the lengths of all actions are wrong, no environment steps and an error is raised. A worker process that dies is one
    error, too, after which the next reset starts all environments anew.

    Args:
        make_envs: one picklable factory per environment; all with the same spaces. The first is called here
            for its spaces and metadata.
        asynchronous: one process per environment instead of one after the other in this process.
        evaluation: who is evaluated on which seeds.
        results_dir: folder of the record of the episodes.

    Raises:
        BimanualError: `results_dir` holds another evaluation of the task.
    """

    def __init__(
        self,
        make_envs: Sequence[Callable[[], BimanualEnv]],
        *,
        asynchronous: bool,
        evaluation: Evaluation | None = None,
        results_dir: str | None = None,
    ):
        recorded = results_dir is not None
        self._make_envs = [partial(_make, make_env, recorded, asynchronous) for make_env in make_envs]
        self._asynchronous = asynchronous
        self._running: SyncVectorEnv | AsyncVectorEnv | None = None
        self._lock = threading.Lock()
        example = make_envs[0]()
        self.num_envs = len(make_envs)
        self.metadata = {**example.metadata, "autoreset_mode": AutoresetMode.NEXT_STEP}
        self.render_mode = example.render_mode
        self.single_observation_space = example.observation_space
        self.single_action_space = example.action_space
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)
        self.action_space = batch_space(self.single_action_space, self.num_envs)
        self._action_lengths = example.action_lengths
        who, options = evaluation or Evaluation(), replace(example.options, results_dir=results_dir)
        self._episodes = EvaluationLog(example.task, options, self.num_envs, who)
        self._is_recorded = results_dir is not None
        self._skipped_episodes: dict[int, Episode | None] = {}
        example.close()
        if asynchronous:  # so that it imports what workers need while LeRobot loads the policy
            multiprocessing.set_forkserver_preload(PRELOADED_IN_FORK_SERVER)
            ensure_fork_server()

    def _ensure(self) -> SyncVectorEnv | AsyncVectorEnv:
        """Start the environments unless they run; LeRobot calls this by name to start the next task's early."""
        with self._lock:
            if self._running is None:
                if self._asynchronous:
                    with clear_errors_of_start(), _main_module_hidden(), _report_worker_death():
                        self._running = AsyncVectorEnv(
                            self._make_envs, context="forkserver", autoreset_mode=AutoresetMode.NEXT_STEP
                        )
                else:
                    self._running = SyncVectorEnv(self._make_envs, autoreset_mode=AutoresetMode.NEXT_STEP)
            return self._running

    def _call_envs[Answer](self, question: Callable[[SyncVectorEnv | AsyncVectorEnv], Answer]) -> Answer:
        """Call `question` with the environments; after an error, worker processes are ended, as they are unusable."""
        envs = self._ensure()
        try:
            with _report_worker_death(envs.processes if isinstance(envs, AsyncVectorEnv) else ()):
                return question(envs)
        except WrappedError as carried:
            self._drop()
            raise carried.error from None
        except BaseException:
            self._drop()
            raise

    def _drop(self) -> None:
        """Forget workers that are dead or in disorder; environments of this process stay."""
        with self._lock:
            if isinstance(envs := self._running, AsyncVectorEnv):
                self._running = None
                for process in envs.processes:
                    process.terminate()
                for process, pipe in zip(envs.processes, envs.parent_pipes, strict=True):
                    process.join()
                    if pipe is not None:  # as Gymnasium leaves it after an error
                        pipe.close()
                envs.closed = True

    def reset(
        self, *, seed: int | list[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Start an episode in every environment; a single seed is counted up.

        Raises:
            InvalidChoice: the seeds or options are invalid.
            WorkerDied: a worker has died; the next reset starts all environments anew.
        """
        seeds, chosen = _checked_seeds(seed, self.num_envs), checked_reset_options(options)
        if self._is_recorded and "variation" in chosen:
            allowed = "an option of the environments, which their record names"
            raise InvalidChoice("variation", chosen["variation"], allowed)
        is_reset = np.asarray(chosen.get("reset_mask", np.ones(self.num_envs)))
        observations, info = self._call_envs(lambda envs: envs.reset(seed=seeds, options=options))
        begun = {index: seeds[index] for index in np.flatnonzero(is_reset).tolist()}
        kept = {index: episode for index, episode in self._skipped_episodes.items() if index not in begun}
        self._skipped_episodes = kept | self._episodes.begin(begun)
        return observations, info

    def step(self, actions: Any) -> tuple[Any, Any, Any, Any, dict[str, Any]]:
        """Step every environment; `actions` (num_envs, 16) or (num_envs, 18).

        Raises:
            InvalidAction: all actions have a shape or type that no environment takes.
            WorkerDied: a worker has died; the next reset starts all environments anew.
        """
        arrays: list[Any] = [*self._arrays(actions)]
        for index, episode in self._skipped_episodes.items():
            arrays[index] = SkippedEpisode(episode is not None and episode.success)
        observations, rewards, terminated, truncated, info = self._call_envs(lambda envs: envs.step(arrays))
        self._episodes.note(terminated | truncated, info)
        return observations, rewards, terminated, truncated, info

    def _arrays(self, actions: Any) -> list[NDArray | InvalidAction]:
        """The action of each environment as an array, which the environment checks, or the error of an unreadable action."""
        rows = list(actions) if isinstance(actions, Iterable) else []
        if len(rows) != self.num_envs:
            shape = f" of shape {tuple(actions.shape)}" if isinstance(actions, np.ndarray) else ""
            got = f"{type(actions).__name__}{shape}"
            raise InvalidAction(f"{self.num_envs} environments take as many actions, got {got}")
        arrays = [as_array(row) for row in rows]
        shapes = {row.shape for row in arrays if isinstance(row, np.ndarray)}
        if not shapes & {(length,) for length in self._action_lengths}:
            valid = " or ".join(map(str, self._action_lengths))
            unreadable = next((row for row in arrays if isinstance(row, InvalidAction)), None)
            raise unreadable or InvalidAction(
                f"an action is a vector of {valid} numbers, got shape {min(shapes)}"
            )
        self.metadata["render_fps"] = KEYPOSE_FPS if shapes == {(KEYPOSE_DIM,)} else CONTROL_HZ
        return arrays

    def render(self) -> tuple[Any, ...] | None:
        """A frame of every environment."""
        return self._call_envs(lambda envs: envs.render())

    def call(self, name: str, *args: Any, **kwargs: Any) -> tuple[Any, ...]:
        """Call a method, or get an attribute, of every environment."""
        return self._call_envs(lambda envs: envs.call(name, *args, **kwargs))

    def get_attr(self, name: str) -> tuple[Any, ...]:
        """Get an attribute of every environment."""
        return self._call_envs(lambda envs: envs.get_attr(name))

    def close(self, **kwargs: Any) -> None:
        """Close the environments and end their processes, dead ones included."""
        if isinstance(envs := self._running, AsyncVectorEnv) and not all(
            process.is_alive() for process in envs.processes
        ):
            self._drop()
        with self._lock:
            if self._running is not None:
                self._running.close(**kwargs)
                self._running = None
        self._episodes.close()


@contextlib.contextmanager
def _report_worker_death(processes: Sequence[BaseProcess] = ()) -> Iterator[None]:
    """Say which process died when its pipe breaks."""
    try:
        yield
    except (EOFError, BrokenPipeError, ConnectionResetError) as error:
        dead = connection.wait([process.sentinel for process in processes], timeout=TIMEOUT_S)
        ends = [
            f"{number} ({exit_reason(process)})"
            for number, process in enumerate(processes)
            if process.sentinel in dead
        ]
        which = f"of environment {', '.join(ends)}" if ends else "of an environment"
        # The frames of the traceback hold the bytes that were not sent, on which garbage collection crashes in Python 3.12.1.
        raise WorkerDied(
            f"the worker process {which} died, most likely because memory ran out: reset() starts all environments again; "
            "if it dies again, use fewer environments (--eval.batch_size)"
        ) from error.with_traceback(None)


def _checked_seeds(seed: Any, count: int) -> list[int | None]:
    """The seeds of several environments: those of a list, or a single one counted up."""
    if isinstance(seed, list | tuple | np.ndarray):
        if len(seed) != count:
            raise InvalidChoice("seed", seed, f"a list of {count}, one per environment, or a single seed")
        return [checked_seed(single) for single in seed]
    first = checked_seed(seed)
    return [None if first is None else checked_seed(first + index) for index in range(count)]


def as_array(action: Any) -> NDArray | InvalidAction:
    """A copy of an action, since a policy may write its next one into the same memory, or the error if it cannot be read."""
    if isinstance(action, InvalidAction):
        return action
    try:
        array = np.array(action)
    except (ValueError, TypeError, RuntimeError) as error:  # ragged, or a tensor that requires its gradient
        return InvalidAction(f"an action is a vector of numbers, got what NumPy cannot read: {error}")
    if array.dtype.kind not in "biuf":
        return InvalidAction(
            f"an action is a vector of numbers, got a {type(action).__name__} of {array.dtype}"
        )
    return array

"""Where the time of `lerobot-eval` goes on every task, here and in another tree, in turns on the same machine.

Each turn scores the same episodes with LeRobot's own program and a trained small PerAct2. Its network is run on every
observation, but the hands go where the expert's went: so all tasks are played to their end by one checkpoint. Times are
CPU times of the program and all its workers, without the start of the program (benchmarks/starting.py). What an
evaluation pays once, from reading options to starting OpenGL, is told from what every episode costs by two evaluations
of different length. A batch of 1 is played in one process, whose stages are told apart. LeRobot films the first ten
episodes only. Prints one line of JSON per task and batch.

    python benchmarks/scoring.py --before=/path/to/another/tree
    python benchmarks/scoring.py --tasks=lift_ball --episodes=50 --batches 1 2
"""

import argparse
import json
import multiprocessing.forkserver
import os
import statistics
import subprocess
import sys
import tempfile
import threading
import time
from collections import defaultdict
from pathlib import Path
from typing import Any

HERE = Path(__file__).parents[1]
CHECKPOINT = HERE / "results/checkpoints/peract2_on_all"
IMAGE_SIZE = 128
FIRST_SEED = 1000

STAGES = ("reset", "planning", "physics", "checks", "observation", "policy", "LeRobot's video", "rest")


type Turn = tuple[dict[str, float], dict[str, float]]
"""CPU seconds by stage of a short evaluation and of a longer one."""


class Stages:
    """CPU seconds and calls of parts of a program, each with all that it calls."""

    def __init__(self):
        self.seconds: defaultdict[str, float] = defaultdict(float)
        self.calls: defaultdict[str, int] = defaultdict(int)
        self._thread = threading.local()

    def watch(self, owner: Any, name: str, stage: str) -> None:
        """Count a function or method to a stage, unless it is called from inside of one."""
        watched = getattr(owner, name)

        def timed(*args: Any, **kwargs: Any) -> Any:
            if getattr(self._thread, "inside", False):
                return watched(*args, **kwargs)
            self._thread.inside = True
            start = time.thread_time()
            try:
                return watched(*args, **kwargs)
            finally:
                self.seconds[stage] += time.thread_time() - start
                self.calls[stage] += 1
                self._thread.inside = False

        setattr(owner, name, timed)


class ExpertHands:
    """Makes keypose policies compute their action, and then take the expert's of the same seed and step.

    LeRobot plays the seeds in their order, some at a time, and resets the policy before each batch.
    """

    def __init__(self):
        self._task = ""
        self._keyposes: list[list[Any]] = []
        self._batch_size = 1
        self._first = 0

    def install(self) -> None:
        """Replace what LeRobot calls of a policy."""
        import lerobot_policy_bimanual.configurations  # noqa: F401  registers the policies: the package comes before LeRobot
        from lerobot_policy_bimanual.keypose.policy import KeyposePolicy

        def select_action(policy: KeyposePolicy, batch: dict[str, Any], **_: Any) -> Any:
            policy.infer(batch)
            return self._act(batch["observation.keypose_step"].flatten().int().tolist())

        KeyposePolicy.select_action = select_action  # pyright: ignore[reportAttributeAccessIssue]
        KeyposePolicy.reset = lambda _: self._next_batch()  # pyright: ignore[reportAttributeAccessIssue]

    def learn(self, task: str, episodes: int, batch_size: int) -> None:
        """Play the episodes of an evaluation, once per task."""
        from lerobot_env_bimanual.env import BimanualEnv
        from lerobot_env_bimanual.experts.runner import Move, run_expert

        if task != self._task:
            self._task, self._keyposes = task, []
        env = BimanualEnv(task, obs="state", control_mode="keypose")
        while len(self._keyposes) < -(-episodes // batch_size) * batch_size:
            moves: list[Move] = []
            run_expert(env, FIRST_SEED + len(self._keyposes), on_move=moves.append)
            self._keyposes.append([move.action for move in moves])
        env.close()
        self._batch_size = batch_size

    def start_over(self) -> None:
        """Before an evaluation: the next batch is the first."""
        self._first = -self._batch_size

    def _next_batch(self) -> None:
        self._first += self._batch_size

    def _act(self, steps: list[int]) -> Any:
        import torch

        rows = (self._keyposes[self._first + row] for row in range(len(steps)))
        actions = [row[min(step, len(row) - 1)] for row, step in zip(rows, steps, strict=True)]
        return torch.stack([torch.from_numpy(action) for action in actions])


def serve() -> None:
    """Answer every line, flags of `lerobot-eval` as JSON, with what the evaluation cost."""
    answers, sys.stdout = sys.stdout, sys.stderr
    hands, stages = ExpertHands(), Stages()
    hands.install()
    watch_rollouts(stages)
    is_warm = False
    for line in sys.stdin:
        flags = json.loads(line)
        hands.learn(flags["env.task"], flags["eval.n_episodes"], flags["eval.batch_size"])
        if not is_warm:  # libraries load much of themselves when they are first used
            evaluate(flags, hands, stages)
            is_warm = True
        print(json.dumps(evaluate(flags, hands, stages)), file=answers, flush=True)


def evaluate(flags: dict[str, Any], hands: ExpertHands, stages: Stages) -> dict[str, Any]:
    """Run `lerobot-eval` with some flags; returns what it cost."""
    from lerobot.scripts import lerobot_eval

    hands.start_over()
    stages.seconds.clear()
    stages.calls.clear()
    with tempfile.TemporaryDirectory() as folder:
        words = {**flags, "output_dir": f"{folder}/out"}
        sys.argv = ["lerobot-eval", *(f"--{name}={value}" for name, value in words.items())]
        start_s = cpu_s()
        lerobot_eval.main()
        total_s = cpu_s() - start_s
        info = json.loads(Path(folder, "out/eval_info.json").read_text())
    stages_s = {**stages.seconds, "rest": total_s - sum(stages.seconds.values())}
    solved = info["overall"]["pc_success"]
    return {"cpu_s": total_s, "solved_percent": solved, "stages_s": stages_s, "calls": stages.calls}


def watch_rollouts(stages: Stages) -> None:
    """Put stopwatches at the stages of a rollout in this process."""
    from lerobot.scripts import lerobot_eval

    from lerobot_env_bimanual import env
    from lerobot_env_bimanual.env import BimanualEnv
    from lerobot_env_bimanual.episode.reset import EpisodeReset
    from lerobot_env_bimanual.motion.planner import KeyposePlanner
    from lerobot_env_bimanual.world.scene import Scene
    from lerobot_policy_bimanual.keypose.policy import KeyposePolicy

    # The name of the check in a tree before conditions were looked at one by one.
    is_new = hasattr(env, "check_until_unmet")
    checks = (env, "check_until_unmet", "checks") if is_new else (BimanualEnv, "_check", "checks")
    for owner, name, stage in (
        checks,
        (EpisodeReset, "start", "reset"),
        (KeyposePlanner, "plan", "planning"),
        (Scene, "tick", "physics"),
        (BimanualEnv, "observe", "observation"),
        (BimanualEnv, "render", "LeRobot's video"),
        (lerobot_eval, "write_video", "LeRobot's video"),
        (KeyposePolicy, "select_action", "policy"),
    ):
        stages.watch(owner, name, stage)


def cpu_s() -> float:
    """CPU seconds of this process, of its fork server and of all workers that have ended."""
    server = multiprocessing.forkserver._forkserver._forkserver_pid  # pyright: ignore[reportAttributeAccessIssue]
    ticks = 0
    if server is not None:
        fields = Path(f"/proc/{server}/stat").read_text().rpartition(")")[2].split()
        ticks = sum(map(int, fields[11:15]))  # user and system time, its own and that of its dead children
    return sum(os.times()[:4]) + ticks / os.sysconf("SC_CLK_TCK")


class Scorer:
    """A process that evaluates with the packages of a tree, on one core."""

    def __init__(self, tree: Path):
        paths = os.pathsep.join(str(tree / folder) for folder in ("", "envs", "policies"))
        self._words = tempfile.TemporaryFile("w+")  # noqa: SIM115  of LeRobot, shown if the process ends too early
        self._process = subprocess.Popen(
            [sys.executable, __file__, "--serve"],
            env={**os.environ, "PYTHONPATH": paths, "OMP_NUM_THREADS": "1", "HF_HUB_OFFLINE": "1"},
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._words,
            text=True,
        )

    def score(self, flags: dict[str, Any]) -> dict[str, Any]:
        """What an evaluation costs."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        print(json.dumps(flags), file=self._process.stdin, flush=True)
        answer = self._process.stdout.readline()
        if not answer:
            self._words.seek(0)
            sys.exit(f"{self._words.read()}\nthe evaluation of {flags['env.task']} ended without an answer")
        return json.loads(answer)

    def close(self) -> None:
        """End the process."""
        self._process.communicate()


def per_episode_ms(turns: list[Turn], episodes: int) -> dict[str, float]:
    """Medians over turns of CPU milliseconds per further episode: all, and by stage."""
    more = [{stage: long[stage] - short[stage] for stage in ("all", *STAGES)} for short, long in turns]
    return {stage: statistics.median(1e3 * turn[stage] / episodes for turn in more) for stage in more[0]}


def seconds(answer: dict[str, Any]) -> dict[str, float]:
    """CPU seconds of an evaluation: all, and by stage."""
    return {"all": answer["cpu_s"]} | {stage: answer["stages_s"].get(stage, 0.0) for stage in STAGES}


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--before", type=Path, help="another tree; without it, only this one is measured")
    parser.add_argument("--tasks", default="", help="names, comma separated; without it all")
    parser.add_argument("--episodes", type=int, default=20, help="by which the longer evaluation is longer")
    parser.add_argument("--batches", type=int, nargs="+", default=[1], help="environments at a time")
    parser.add_argument("--turns", type=int, default=1)
    parser.add_argument("--checkpoint", type=Path, default=CHECKPOINT)
    parser.add_argument("--serve", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.serve:
        serve()
        return

    from lerobot_env_bimanual.tasks.registry import list_tasks

    trees = {"after": HERE} if options.before is None else {"before": options.before.resolve(), "after": HERE}
    scorers = {name: Scorer(tree) for name, tree in trees.items()}
    for task in options.tasks.split(",") if options.tasks else list_tasks():
        for batch_size in options.batches:
            flags = {
                "policy.path": str(options.checkpoint.resolve()),
                "policy.device": "cpu",
                "env.type": "bimanual",
                "env.task": task,
                "env.image_size": IMAGE_SIZE,
                "eval.batch_size": batch_size,
                "seed": FIRST_SEED,
            }
            few, many = batch_size, batch_size + options.episodes
            answers: dict[str, list[list[dict[str, Any]]]] = {name: [] for name in scorers}
            for _ in range(options.turns):
                for name, scorer in scorers.items():
                    answers[name].append(
                        [scorer.score(flags | {"eval.n_episodes": count}) for count in (few, many)]
                    )
            figures: dict[str, Any] = {"task": task, "batch_size": batch_size, "episodes": options.episodes}
            for name, pairs in answers.items():
                milliseconds = per_episode_ms(
                    [(seconds(short), seconds(long)) for short, long in pairs], options.episodes
                )
                short, long = pairs[-1]
                started_s = statistics.median(pair[0]["cpu_s"] for pair in pairs)
                figures[name] = {
                    "once_cpu_s": round(started_s - few * milliseconds["all"] / 1e3, 2),
                    "cpu_ms_per_episode": {stage: round(value, 1) for stage, value in milliseconds.items()},
                    "calls_per_episode": {
                        stage: round((count - short["calls"].get(stage, 0)) / options.episodes, 2)
                        for stage, count in long["calls"].items()
                    },
                    "solved_percent": long["solved_percent"],
                }
            if "before" in figures:
                all_ms = [figures[name]["cpu_ms_per_episode"]["all"] for name in ("before", "after")]
                figures["after_to_before"] = round(all_ms[1] / all_ms[0], 3)
            print(json.dumps(figures), flush=True)
    for scorer in scorers.values():
        scorer.close()


if __name__ == "__main__":
    main()

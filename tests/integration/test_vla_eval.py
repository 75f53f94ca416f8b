"""vla-eval's own client plays our tasks against a model server of its own."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from vla_eval.api import evaluate
from vla_eval.config import EvalConfig
from vla_eval.model_servers.base import ModelServer
from vla_eval.registry import resolve_import_string
from vla_eval.specs import check_specs

from lerobot_bimanual.errors import BimanualError
from lerobot_env_bimanual import vla_eval as room
from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.experts.runner import expert
from lerobot_env_bimanual.tasks.registry import list_tasks
from lerobot_env_bimanual.vla_eval.benchmark import BimanualBenchmark

MANIFEST = Path(str(room.__file__)).with_name("bimanual.yaml")
FEW = {"tasks": "lift_ball,push_box", "seed": 3}
KEYPOSES = {"control_mode": "keypose", "obs": "state"}


class Server(ModelServer):
    """Answers every observation with the next action of a list, and notes what it was sent."""

    def __init__(self, actions: dict[str, list[list[np.ndarray]]], benchmark: BimanualBenchmark):
        self.actions, self.benchmark = actions, benchmark
        self.seen: list[dict[str, Any]] = []
        self.left: Iterator[np.ndarray] = iter(())

    async def on_episode_start(self, config: dict[str, Any], ctx: Any) -> None:
        self.left = iter(self.actions[config["task"]["name"]][config["task"]["episode_idx"]])

    async def on_observation(self, obs: dict[str, Any], ctx: Any) -> None:
        self.seen.append(obs)
        await ctx.send_action({"actions": next(self.left)})

    def get_action_spec(self) -> dict[str, Any]:
        return self.benchmark.get_action_spec()

    def get_observation_spec(self) -> dict[str, Any]:
        return self.benchmark.get_observation_spec()


def demonstrated(task: str, seed: int) -> list[np.ndarray]:
    """The keyposes with which the expert solves an episode."""
    env, actions = BimanualEnv(task, obs="state", control_mode="keypose"), []
    env.reset(seed=seed)
    for move in expert()(env):
        actions.append(move.action)
        if env.step(move.action)[2]:
            break
    env.close()
    return actions


def run(server: Server, params: dict[str, Any], folder: Path, episodes: int = 1) -> dict[str, dict]:
    """The harness' result of every task by name."""
    config = yaml.safe_load(MANIFEST.read_text())
    overrides = {"episodes_per_task": episodes, "params": params}
    (result,) = evaluate(server, config, output_dir=folder, benchmark_overrides=overrides, no_save=True)
    return {task["task"]: task for task in result["tasks"]}


def test_the_manifest_names_the_adapter_and_options_that_it_takes():
    config = yaml.safe_load(MANIFEST.read_text())
    (entry,) = (EvalConfig.from_dict(entry) for entry in config["benchmarks"])
    benchmark = resolve_import_string(entry.benchmark)(**entry.params)
    assert [task["name"] for task in benchmark.get_tasks()] == list(list_tasks())
    joint = benchmark.get_action_spec()
    assert sum(spec.dims for spec in joint.values()) == 16
    assert "left_wrist" in benchmark.get_observation_spec()


def test_conventions_that_differ_are_told():
    joint, keypose = BimanualBenchmark(), BimanualBenchmark(options=KEYPOSES)
    assert sum(spec.dims for spec in keypose.get_action_spec().values()) == 18
    for bench, server, fits in ((joint, joint, True), (keypose, keypose, True), (joint, keypose, False)):
        told = check_specs(server.get_action_spec(), bench.get_action_spec(), {}, {})
        assert (told == []) == fits


@pytest.mark.parametrize(
    ("params", "message"),
    [
        ({"tasks": "push_bax"}, "Did you mean 'push_box'"),
        ({"options": {"control_mode": "auto"}}, "joint, keypose"),
        ({"options": {"image": 64}}, "an option of the environment"),
    ],
)
def test_a_wrong_configuration_is_named(params, message):
    with pytest.raises(BimanualError, match=message):
        BimanualBenchmark(**params)


@pytest.mark.sim
def test_the_harness_solves_with_the_experts_keyposes_what_it_does_not_solve_without(tmp_path):
    benchmark = BimanualBenchmark(**FEW, options=KEYPOSES)
    good = {"lift_ball": [demonstrated("lift_ball", 3)], "push_box": [demonstrated("push_box", 3)]}
    results = run(Server(good, benchmark), FEW | {"options": KEYPOSES}, tmp_path)
    assert {task: result["mean_success"] for task, result in results.items()} == dict.fromkeys(good, 1.0)
    nan = np.full(18, np.nan, np.float32)
    bad = {"lift_ball": [[nan]], "push_box": [good["lift_ball"][0]]}  # neither belongs to the episode
    results = run(Server(bad, benchmark), FEW | {"options": KEYPOSES}, tmp_path)
    assert {task: result["mean_success"] for task, result in results.items()} == dict.fromkeys(bad, 0.0)
    assert [len(result["episodes"]) for result in results.values()] == [1, 1]


@pytest.mark.sim
def test_a_model_server_is_sent_images_depth_calibration_and_words(tmp_path):
    options = {"control_mode": "joint", "obs": "rgbd", "cameras": "front,left_wrist", "image_size": "24x32"}
    params = {"tasks": "lift_ball", "options": options}
    server = Server({"lift_ball": [[np.zeros(3)]]}, BimanualBenchmark(**params))
    (result,) = run(server, params, tmp_path).values()
    assert "16 numbers, got shape (3,)" in result["episodes"][0]["failure_detail"]
    (seen,) = server.seen
    assert seen["task_description"] == "lift the ball"
    assert {camera: image.shape for camera, image in seen["images"].items()} == {
        "front": (24, 32, 3),
        "left_wrist": (24, 32, 3),
    }
    assert {depth.shape for depth in seen["depths"].values()} == {(24, 32)}
    assert seen["states"].shape == (16,)
    for key, side in (("camera_extrinsics", 4), ("camera_intrinsics", 3)):
        assert {camera: matrix.shape for camera, matrix in seen[key].items()} == {
            "front": (side, side),
            "left_wrist": (side, side),
        }
    assert np.all(seen["depths"]["front"] > 100)  # millimetres

"""`lerobot-bimanual policy inspect` and `accuracy`: what the policy saw and said, and how far that is from the truth."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
import torch
from lerobot.configs import PreTrainedConfig
from lerobot.policies.factory import get_policy_class, make_pre_post_processors
from lerobot.policies.pretrained import PreTrainedPolicy
from matplotlib.colors import to_rgb
from PIL import Image

from lerobot_bimanual import cli
from lerobot_bimanual.arms import ARMS
from lerobot_bimanual.cameras import CAMERA_NAMES, intrinsics_from_fovy
from lerobot_bimanual.dataset import schema
from lerobot_bimanual.dataset.reader import INFO_FILE
from lerobot_bimanual.dataset.writer import ViewWriter, write_episode
from lerobot_bimanual.episode import Demonstration, EpisodeMeta, Step
from lerobot_bimanual.keypose import BimanualKeypose
from lerobot_policy_bimanual.inspection.accuracy import measure
from lerobot_policy_bimanual.inspection.inspection import inspect_sample
from lerobot_policy_bimanual.inspection.loading import batch_of, load_policy, open_dataset
from lerobot_policy_bimanual.inspection.sheet import ARM_COLORS, INK
from lerobot_policy_bimanual.keypose.losses import keypose_errors
from lerobot_policy_bimanual.peract2.configuration_peract2 import PerAct2Config
from lerobot_policy_bimanual.peract2.modeling_peract2 import PerAct2Policy

SIDE_PX = 16
ROWS = 3
LOOKING_DOWN = np.array([[0.0, -1, 0, 0.2], [-1, 0, 0, 0], [0, 0, -1, 2.0], [0, 0, 0, 1]])


def record(root: Path, cameras: tuple[str, ...]) -> Path:
    """A dataset of one made-up episode of two stages: cameras look down on noise."""
    rng = np.random.default_rng(0)
    calibration = {
        schema.CAMERA_EXTRINSICS: np.tile(LOOKING_DOWN.ravel(), len(CAMERA_NAMES)),
        schema.CAMERA_INTRINSICS: np.tile(
            intrinsics_from_fovy(np.pi / 3, SIDE_PX, SIDE_PX).ravel(), len(CAMERA_NAMES)
        ),
    }

    def observation(step: int) -> dict[str, np.ndarray]:
        names = (schema.STATE, schema.EE_POSE, schema.GRIPPER_FINGERS)
        noise = {key: rng.uniform(0, 0.04, len(schema.VECTORS[key])) for key in names}
        vectors = noise | calibration | {schema.KEYPOSE_STEP: np.array([step])}
        return {key: vector.astype(np.float32) for key, vector in vectors.items()}

    def images(row: int) -> dict[str, np.ndarray]:
        pictures = {}
        for camera in cameras:
            pictures[schema.image_key(camera)] = rng.integers(0, 256, (SIDE_PX, SIDE_PX, 3), dtype=np.uint8)
            depth_mm = rng.uniform(800, 1300, (1, SIDE_PX, SIDE_PX))
            pictures[schema.depth_key(camera)] = depth_mm.astype(np.float32)
        return pictures

    action = rng.normal(size=len(schema.JOINT_NAMES)).astype(np.float32)
    keypose = np.array(
        [0.3, 0.2, 1.0, 0, 1, 0, 0, 1, 0, 0.3, -0.2, 0.9, 0.6, 0.8, 0, 0, 0, 1], dtype=np.float32
    )
    episode = Demonstration(
        meta=EpisodeMeta("lift_ball", 0, "train", 0, "lift the ball"),
        keyposes=np.stack([keypose, keypose]),
        steps=tuple(Step(observation(stage), action, stage, stage) for stage in range(2)),
        final_observation=observation(2),
        images=images,
    )
    with ViewWriter(root, "local/made_up", "keyframes", cameras, SIDE_PX, SIDE_PX) as writer:
        write_episode(episode, [writer])
    return root


@pytest.fixture(scope="module")
def dataset(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return record(tmp_path_factory.mktemp("data") / "keyframes", CAMERA_NAMES)


def save(policy: PreTrainedPolicy, folder: Path) -> Path:
    """A policy and its processors, written as LeRobot writes them."""
    policy.save_pretrained(folder)
    for processor in make_pre_post_processors(policy.config):
        processor.save_pretrained(folder)
    return folder


def run(checkpoint: Path, dataset: Path, *flags: str) -> int:
    return cli.main(["policy", "inspect", f"--checkpoint={checkpoint}", f"--root={dataset}", *flags])


def count(picture: Image.Image, color: str) -> int:
    """Pixels of about this colour."""
    return int((abs(np.asarray(picture) / 255 - to_rgb(color)).max(axis=-1) < 0.15).sum())


def test_the_command_draws_every_policys_prediction(policy_type, specimens, dataset, tmp_path, capsys):
    options = next(iter(specimens[policy_type].tiny.values()))
    policy = get_policy_class(policy_type)(PreTrainedConfig.get_choice_class(policy_type)(**options))
    checkpoint = save(policy, tmp_path / "pretrained_model")
    # A root of both views holds them as folders.
    assert run(checkpoint, dataset.parent, "--index=1", f"--output={tmp_path / 'pictures'}") == 0
    (path,) = (tmp_path / "pictures").iterdir()
    assert path.name == "row_00001.png"
    assert str(path) in capsys.readouterr().out
    with Image.open(path) as picture:
        picture = picture.convert("RGB")
    assert picture.width > 1500
    views = picture.crop((0, picture.height // 4, picture.width, picture.height))
    for color in (*ARM_COLORS.values(), INK):
        assert count(views, color) > 50


def test_accuracy_is_that_of_each_policys_actions(policy_type, specimens, dataset, tmp_path, capsys):
    options = next(iter(specimens[policy_type].tiny.values()))
    policy = get_policy_class(policy_type)(PreTrainedConfig.get_choice_class(policy_type)(**options))
    checkpoint = save(policy, tmp_path / "pretrained_model")
    policy, preprocess = load_policy(checkpoint)
    found = measure(policy, preprocess, open_dataset(dataset))
    assert found["after"].tolist() == [row for row in range(ROWS) for _ in ARMS]
    dataset_rows = open_dataset(dataset)
    for row in range(ROWS):
        batch = preprocess(batch_of(dataset_rows, [row]))
        action, label = policy.select_action(batch), batch[schema.NEXT_KEYPOSE]
        predicted, true = BimanualKeypose.from_vector(action[0]), BimanualKeypose.from_vector(label[0])
        for arm in ARMS:
            (line,) = found[(found["after"] == row) & (found["arm"] == arm)].itertuples()
            offset_m = predicted[arm].pose.position - true[arm].pose.position
            assert line.cm == pytest.approx(100 * np.linalg.norm(offset_m), rel=1e-4)
            assert line.gripper == (predicted[arm].gripper_open != true[arm].gripper_open)
    capsys.readouterr()
    assert cli.main(["policy", "accuracy", f"--checkpoint={checkpoint}", f"--root={dataset}"]) == 0
    last = capsys.readouterr().out.splitlines()[-1].split()
    assert last[:3] == ["all", "both", str(2 * ROWS)]
    assert float(last[3]) == pytest.approx(found["cm"].mean(), abs=0.006)


def test_what_is_shown_is_the_prediction_and_the_label(make_policy, make_batch):
    policy, batch = make_policy(), make_batch(samples=1)
    inspection = inspect_sample(policy, batch)
    chosen, label = policy.select_action(batch), batch[schema.NEXT_KEYPOSE]
    predicted, true = BimanualKeypose.from_vector(chosen[0]), BimanualKeypose.from_vector(label[0])
    errors = keypose_errors(chosen, label)
    for arm, shown in zip(ARMS, inspection.arms, strict=True):
        assert shown.arm == arm
        np.testing.assert_array_equal(shown.predicted.pose.position, predicted[arm].pose.position)
        np.testing.assert_array_equal(shown.true.pose.quat_wxyz, true[arm].pose.quat_wxyz)
        assert f"{float(errors[f'{arm}_position_cm']):.1f} cm off" in shown.numbers
        assert f"{float(errors[f'{arm}_rotation_deg']):.0f}° off" in shown.numbers
        # The hottest voxel, drawn last, is the one that is commanded.
        np.testing.assert_allclose(shown.hot_m[-1], predicted[arm].pose.position, atol=1e-6)
        assert (np.diff(shown.heat) >= 0).all()
    assert inspection.instruction == batch["task"][0]
    assert all(policy.config.workspace.contains(inspection.scene_m))


def test_voxel_probabilities_are_one_distribution_whose_peak_is_chosen(make_policy, make_batch):
    policy = make_policy()
    translation = policy.infer(make_batch(samples=2))[1].translation
    probabilities = translation.probabilities()
    torch.testing.assert_close(probabilities.sum(dim=(2, 3, 4)), torch.ones(2, 2))
    best = translation.candidates().best()
    at_best = probabilities[torch.arange(2)[:, None], torch.arange(2), *best.unbind(-1)]
    torch.testing.assert_close(at_best, probabilities.amax(dim=(2, 3, 4)))


def refusal(capsys: pytest.CaptureFixture[str], checkpoint: Path, dataset: Path, *flags: str) -> str:
    assert run(checkpoint, dataset, *flags) == 1
    (line,) = (line for line in capsys.readouterr().err.splitlines() if line.startswith("lerobot-bimanual:"))
    return line


def test_a_checkpoint_that_is_none_is_refused(dataset, tmp_path, capsys):
    assert "pretrained_model" in refusal(capsys, tmp_path / "nowhere", dataset)
    (tmp_path / "config.json").write_text('{"type": "act"}')
    message = refusal(capsys, tmp_path, dataset)
    assert "'act'" in message
    assert "peract2" in message


@pytest.fixture
def peract_checkpoint(tiny, tmp_path: Path) -> Path:
    policy = PerAct2Policy(PerAct2Config(**tiny))
    return save(policy, tmp_path / "peract2")


def test_a_row_that_is_not_there_is_refused_with_the_rows_that_are(peract_checkpoint, dataset, capsys):
    for index in (-1, ROWS):
        message = refusal(capsys, peract_checkpoint, dataset, f"--index={index}")
        assert f"has {ROWS} rows" in message


def test_a_dataset_without_depth_or_label_is_refused_by_name(peract_checkpoint, dataset, tmp_path, capsys):
    few = record(tmp_path / "few", ("front",))
    assert schema.depth_key("left_wrist") in refusal(capsys, peract_checkpoint, few)
    copy = shutil.copytree(dataset, tmp_path / "copy")
    info = json.loads((copy / INFO_FILE).read_text())
    del info["features"][schema.NEXT_KEYPOSE]
    (copy / INFO_FILE).write_text(json.dumps(info))
    assert f"{schema.NEXT_KEYPOSE} is missing" in refusal(capsys, peract_checkpoint, copy)
    assert "no dataset at" in refusal(capsys, peract_checkpoint, tmp_path / "nowhere")

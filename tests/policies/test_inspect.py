"""`lerobot-bimanual policy inspect` and `accuracy`: what the policy saw and said, and how far that is from the truth."""

import shutil
from pathlib import Path

import numpy as np
import pytest
import torch
from corruptions import rewrite
from matplotlib.colors import to_rgb
from PIL import Image

from lerobot_bimanual import cli
from lerobot_bimanual.arms import ARMS
from lerobot_bimanual.cameras import CAMERA_NAMES
from lerobot_bimanual.dataset import schema
from lerobot_bimanual.dataset.reader import INFO_FILE
from lerobot_bimanual.dataset.writer import ViewWriter, write_episode
from lerobot_bimanual.episode import Demonstration, EpisodeMeta, Step
from lerobot_bimanual.joint_action import JOINT_ACTION_DIM
from lerobot_bimanual.keypose import BimanualKeypose
from lerobot_policy_bimanual.inspection.accuracy import measure
from lerobot_policy_bimanual.inspection.loading import batch_of, load_policy, open_dataset
from lerobot_policy_bimanual.inspection.sheet import ARM_COLORS, INK, draw_sheet, hot_voxels
from lerobot_policy_bimanual.keypose.losses import keypose_errors

ROWS = 3
NO_JOINT_ACTION = np.zeros(JOINT_ACTION_DIM, np.float32)


def record(root: Path, batch: dict, cameras: tuple[str, ...]) -> Path:
    """A dataset of one made-up episode of two stages, whose rows are those of a batch."""

    def observation(row: int) -> dict[str, np.ndarray]:
        return {key: batch[key][row].numpy() for key in schema.VECTORS}

    def images(row: int) -> dict[str, np.ndarray]:
        keys = map(schema.image_key, cameras)
        rgb = {key: (255 * batch[key][row]).byte().permute(1, 2, 0).numpy() for key in keys}
        return rgb | {key: batch[key][row].numpy() for key in map(schema.depth_key, cameras)}

    episode = Demonstration(
        meta=EpisodeMeta("lift_ball", 0, "train", 0, "lift the ball"),
        keyposes=batch[schema.ACTION][:2].numpy(),
        steps=tuple(Step(observation(row), NO_JOINT_ACTION, row, row) for row in range(2)),
        final_observation=observation(2),
        images=images,
    )
    with ViewWriter(root, "local/made_up", "keyframes", cameras, 16, 16) as writer:
        write_episode(episode, [writer])
    return root


@pytest.fixture(scope="module")
def dataset(tmp_path_factory: pytest.TempPathFactory, make_batch) -> Path:
    return record(tmp_path_factory.mktemp("data") / "keyframes", make_batch(ROWS), CAMERA_NAMES)


def run(checkpoint: Path, dataset: Path, *flags: str) -> int:
    return cli.main(["policy", "inspect", f"--checkpoint={checkpoint}", f"--root={dataset}", *flags])


@pytest.mark.slow
def test_the_command_draws_every_prediction(tiny_checkpoint, dataset, tmp_path, capsys):
    # A root of both views holds them as folders.
    assert run(tiny_checkpoint, dataset.parent, "--index=1", f"--output={tmp_path / 'pictures'}") == 0
    (path,) = (tmp_path / "pictures").iterdir()
    assert path.name == "row_00001.png"
    assert str(path) in capsys.readouterr().out
    with Image.open(path) as picture:
        pixels = np.asarray(picture.convert("RGB")) / 255
    assert pixels.shape[1] > 1500
    views = pixels[len(pixels) // 4 :]
    for color in (*ARM_COLORS.values(), INK):
        is_near = abs(views - to_rgb(color)).max(axis=-1) < 0.15
        assert is_near.sum() > 50


@pytest.mark.slow
def test_policy_accuracy_reports_the_errors_of_the_actions(tiny_checkpoint, dataset, capsys):
    policy, preprocess = load_policy(tiny_checkpoint)
    rows = open_dataset(dataset)
    found = measure(policy, preprocess, rows)
    assert found["after"].tolist() == [row for row in range(ROWS) for _ in ARMS]
    for row in range(ROWS):
        batch = preprocess(batch_of(rows, [row]))
        action, label = policy.select_action(batch), batch[schema.ACTION]
        predicted, true = BimanualKeypose.from_vector(action[0]), BimanualKeypose.from_vector(label[0])
        for arm in ARMS:
            (line,) = found[(found["after"] == row) & (found["arm"] == arm)].itertuples()
            offset_m = predicted[arm].pose.position - true[arm].pose.position
            assert line.cm == pytest.approx(100 * np.linalg.norm(offset_m), rel=1e-4)
            assert line.gripper == (predicted[arm].gripper_open != true[arm].gripper_open)
    assert cli.main(["policy", "accuracy", f"--checkpoint={tiny_checkpoint}", f"--root={dataset}"]) == 0
    said = capsys.readouterr().out
    assert f"on {dataset}; after: keyposes before" in said  # made up, so of no split
    last = said.splitlines()[-1].split()
    assert last[:3] == ["all", "both", str(2 * ROWS)]
    assert float(last[3]) == pytest.approx(found["cm"].mean(), abs=0.006)
    assert max(map(len, last)) < 8  # rounded


def test_a_sheet_shows_the_predicted_keypose_and_probabilities_that_sum_to_one(make_policy, make_batch):
    policy, batch = make_policy(), make_batch()
    _, prediction, chosen = policy.infer(batch)
    predicted = BimanualKeypose.from_vector(chosen[0])
    errors = keypose_errors(chosen[:1], batch[schema.ACTION][:1])
    (legend,) = draw_sheet(policy, batch, "a test").legends
    texts = [text.get_text() for text in legend.get_texts()]
    probabilities = prediction.translation.probabilities()
    for arm, volume in zip(ARMS, probabilities[0], strict=True):
        cm, deg = (float(errors[f"{arm}_{error}"]) for error in ("position_cm", "rotation_deg"))
        assert any(text.startswith(f"{arm} arm: {cm:.1f} cm and {deg:.0f}° off") for text in texts)
        # The hottest voxel, drawn last, is the one that is commanded.
        hot_m, heat = hot_voxels(volume, policy.codec)
        np.testing.assert_allclose(hot_m[-1], predicted[arm].pose.position, atol=1e-6)
        assert (np.diff(heat) >= 0).all()
    torch.testing.assert_close(probabilities.sum(dim=(2, 3, 4)), torch.ones(2, 2))
    best = prediction.translation.candidates().best()
    at_best = probabilities[torch.arange(2)[:, None], torch.arange(2), *best.unbind(-1)]
    torch.testing.assert_close(at_best, probabilities.amax(dim=(2, 3, 4)))


def refusal(capsys: pytest.CaptureFixture[str], checkpoint: Path, dataset: Path, *flags: str) -> str:
    assert run(checkpoint, dataset, *flags) == 1
    (line,) = (line for line in capsys.readouterr().err.splitlines() if line.startswith("lerobot-bimanual:"))
    return line


def test_missing_rows_depth_or_labels_are_refused_by_name(
    save_policy, tiny, dataset, make_batch, tmp_path, capsys
):
    checkpoint = save_policy("peract2", tiny, tmp_path / "peract2")
    for index in (-1, ROWS):
        assert f"has {ROWS} rows" in refusal(capsys, checkpoint, dataset, f"--index={index}")
    few = record(tmp_path / "few", make_batch(ROWS), ("front",))
    assert schema.depth_key("left_wrist") in refusal(capsys, checkpoint, few)
    copy = shutil.copytree(dataset, tmp_path / "copy")
    rewrite(copy / INFO_FILE, lambda info: info["features"].pop(schema.ACTION))
    assert f"{schema.ACTION} is missing" in refusal(capsys, checkpoint, copy)

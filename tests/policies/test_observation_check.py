"""Policies check observations: an impossible one is an error, one unlike the training causes a warning."""

import re

import pandas as pd
import pytest
import torch
from lerobot.configs import FeatureType, PolicyFeature
from lerobot.policies.factory import get_policy_class
from lerobot.utils.feature_utils import dataset_to_policy_features
from sample_results import provenance

from lerobot_bimanual.cameras import CAMERA_NAMES
from lerobot_bimanual.dataset import schema
from lerobot_bimanual.dataset.calibration import Calibration
from lerobot_bimanual.dataset.feature_table import features
from lerobot_bimanual.dataset.provenance import PROVENANCE_FILE
from lerobot_bimanual.errors import DatasetError
from lerobot_bimanual.geometry.pinhole_torch import unproject
from lerobot_policy_bimanual import PerAct2Config
from lerobot_policy_bimanual.errors import BadObservation
from lerobot_policy_bimanual.keypose.dataset_fit import fit_config
from lerobot_policy_bimanual.keypose.observation import observe

RGB, DEPTH = schema.image_key("front"), schema.depth_key("front")


def changed(change, *keys):
    """A function that changes these columns of a batch."""
    return lambda batch: batch.update({key: change(batch[key]) for key in keys})


def without(*keys):
    return lambda batch: [batch.pop(key) for key in keys]


ALL_DEPTHS = tuple(map(schema.depth_key, CAMERA_NAMES))
WRONG = {
    "no depth": (without(*ALL_DEPTHS), r"front_depth.*--env\.obs=rgbd.*--rename_map"),
    "no calibration": (without(schema.CAMERA_INTRINSICS), "lacks observation.camera_intrinsics"),
    "no instruction": (without("task"), "lacks task, "),
    "no sample": (changed(lambda _: [], "task"), "holds 0 instructions"),
    "an instruction too few": (changed(lambda task: task[:1], "task"), "holds 1 instructions"),
    "a state of another robot": (changed(lambda state: state[:, :7], schema.STATE), r"shape \(2, 16\), as"),
    "channels last": (changed(lambda rgb: rgb.permute(0, 2, 3, 1), RGB), r"the shape \(2, 3, 16, 3\)"),
    "no pixels": (changed(lambda image: image[..., :0], RGB, DEPTH), r"\(2, 3, 16, 0\)"),
    "depth of another size": (changed(lambda depth: depth[..., ::2, ::2], DEPTH), "be aligned to colour"),
    "depth without its channel": (changed(lambda depth: depth[:, 0], DEPTH), r"the shape \(2, 1, 16, 16\)"),
    "depth in metres": (changed(lambda depth: depth / 1000, DEPTH), "in millimetres.*depth_output_unit=m"),
    "depth below zero": (changed(lambda depth: depth - 1000, DEPTH), "goes from -"),
    "RGB in bytes": (changed(lambda rgb: (rgb * 255).byte(), RGB), "to 25.*divide 0..255 by 255"),
    "RGB that is NaN": (changed(lambda rgb: rgb * torch.nan, RGB), "goes from nan"),
    "all cameras off": (changed(torch.zeros_like, *ALL_DEPTHS), "no camera has any depth"),
    "all cameras off in one sample": (
        changed(lambda depth: depth * torch.tensor([1.0, 0])[:, None, None, None], *ALL_DEPTHS),
        "no camera has any depth",
    ),
}


def test_an_impossible_observation_is_refused_on_one_line_also_after_the_first_call(make_policy, make_batch):
    policy = make_policy()
    policy.select_action(make_batch())
    for change, message in WRONG.values():
        batch = make_batch()
        change(batch)
        for use in (policy.select_action, policy.train().forward):
            with pytest.raises(BadObservation, match=message) as refusal:
                use(batch)
            assert "\n" not in str(refusal.value)


FINE = {
    "depth in 16 bits": changed(lambda depth: depth.to(torch.uint16), DEPTH),
    "RGB in 64 bits": changed(lambda rgb: rgb.double(), RGB),
    "pixels that are no number": changed(lambda depth: depth.where(depth < 900, torch.nan), DEPTH),
    "pixels that a dataset stores as none": changed(lambda depth: depth.where(depth < 900, 10), DEPTH),
    "a camera of another size": changed(lambda image: image.repeat_interleave(2, dim=-1), RGB, DEPTH),
    "a bit above one": changed(lambda rgb: rgb * 1.009, RGB),
    "a tuple of instructions": changed(tuple, "task"),
    "a step as LeRobot's loader gives it": changed(lambda step: step[:, 0], schema.KEYPOSE_STEP),
}


def test_other_kinds_of_numbers_and_images_and_pixels_without_depth_are_fine(make_policy, make_batch, caplog):
    policy = make_policy()
    for change in FINE.values():
        batch = make_batch()
        change(batch)
        assert torch.isfinite(policy.select_action(batch)).all()
    assert torch.isfinite(policy.train()(batch)[0])
    assert not caplog.records


def test_cameras_that_are_off_are_warned_of_once(make_policy, make_batch, caplog):
    policy, batch = make_policy(), make_batch()
    off = dict(zip(CAMERA_NAMES[:3], (0, torch.nan, 10), strict=True))
    for camera, nothing in off.items():
        batch[schema.depth_key(camera)].fill_(nothing)
    for _ in range(2):
        assert torch.isfinite(policy.select_action(batch)).all()
    for camera, warning in zip(off, caplog.messages, strict=True):
        assert f"{camera}_depth has no depth at all" in warning


class Meta:
    """What LeRobot says of a dataset, as far as a policy looks."""

    root = "nowhere"

    def __init__(self, instructions, height, width, view="keyframes", calibration=None):
        self.tasks = pd.DataFrame({"task_index": range(len(instructions))}, index=list(instructions))
        self.features = features(CAMERA_NAMES, height, width, view, calibration=calibration)


def test_another_task_and_another_size_are_warned_of_once(make_policy, make_batch, caplog, tmp_path):
    policy = make_policy()
    policy.config.input_features = {
        key: PolicyFeature(FeatureType.VISUAL, (3, 8, 8)) for key in policy.config.observation_keys
    }
    meta = Meta(["push the box"], height=32, width=24)
    meta.root = tmp_path / "data"
    provenance(worlds={"push_box": "0123456789ab"}).write(meta.root / PROVENANCE_FILE)
    fit_config(policy.config, meta, None)
    (other,) = caplog.messages
    assert re.search(r"policy's training: .*images\.front is \(3, 32, 24\), not \(3, 8, 8\)", other)
    caplog.clear()
    policy.save_pretrained(tmp_path)
    restored = type(policy).from_pretrained(tmp_path)
    assert restored.config.trained_instructions == ("push the box",)
    assert restored.config.trained_worlds == {"push_box": "0123456789ab"}
    for sentence in ("lift the ball 0", "tidy up"):
        restored.select_action(make_batch() | {"task": [sentence] * 2})
    size, task = caplog.messages
    assert re.search(r"images of 32 x 24 .*front has 16 x 16.*--env\.image_size=32x24", size)
    assert re.search(r"instruction 'lift the ball 0', but with 'push the box': .*--env\.task", task)


def test_a_batch_of_rows_is_completed_with_the_calibration_of_all_rows(make_policy, make_batch):
    batch, config = make_batch(), make_policy().config
    batch[schema.CAMERA_EXTRINSICS] += 0.001 * torch.arange(80)  # every camera has a calibration of its own
    batch[schema.CAMERA_INTRINSICS] *= 1 + 0.001 * torch.arange(45)
    first = {key: batch[key][0].numpy() for key in (schema.CAMERA_EXTRINSICS, schema.CAMERA_INTRINSICS)}
    calibration = Calibration.of_observation(first)
    torch.manual_seed(0)
    meta = Meta(["lift"], 16, 16, calibration=calibration)
    policy = get_policy_class(config.type)(config, dataset_meta=meta).eval()
    rows = {key: value for key, value in batch.items() if key != schema.CAMERA_INTRINSICS}
    rows[schema.WRIST_EXTRINSICS] = rows.pop(schema.CAMERA_EXTRINSICS)[:, 48:]
    assert torch.equal(policy(rows)[0], policy(batch)[0])
    wrists = rows.pop(schema.WRIST_EXTRINSICS)
    with pytest.raises(BadObservation, match=schema.CAMERA_EXTRINSICS):
        policy(rows)
    policy.calibration = None
    with pytest.raises(BadObservation, match=schema.CAMERA_EXTRINSICS):
        policy(rows | {schema.WRIST_EXTRINSICS: wrists})


def test_a_further_camera_can_be_learned_from_where_the_dataset_has_it(make_policy):
    meta, config = Meta(["lift"], 16, 16), make_policy(cameras=("front",)).config
    config.input_features = dataset_to_policy_features(meta.features)
    config.validate_features()  # as a checkpoint has it
    config.cameras = ("front", "left_wrist")
    make, further = get_policy_class(config.type), schema.depth_key("left_wrist")
    with pytest.raises(
        DatasetError, match=f"{further} are neither in the dataset nor inputs of the checkpoint"
    ):
        make(config)
    assert further in make(config, dataset_meta=meta).config.input_features


def test_datasets_of_joint_actions_are_refused():
    with pytest.raises(DatasetError, match=r"has the shape \(16,\), .* the view `keyframes`"):
        fit_config(PerAct2Config(device="cpu"), Meta(["lift"], 16, 16, "frames"), None)


def test_measured_pixels_give_the_same_points_bit_for_bit_and_unmeasured_pixels_give_none(make_batch):
    batch = make_batch()
    batch[schema.CAMERA_EXTRINSICS] += 0.001 * torch.arange(80)  # every camera has a calibration of its own
    batch[schema.CAMERA_INTRINSICS] *= 1 + 0.001 * torch.arange(45)
    for index, camera in enumerate(CAMERA_NAMES):
        key = schema.depth_key(camera)
        batch[key][..., 0, 0] = 11  # the next that a dataset can store
        whole = observe(batch, cameras=(camera,), keypose_horizon=5).points
        expected = unproject(
            batch[key][:, 0] / 1000,
            batch[schema.CAMERA_INTRINSICS].unflatten(-1, (5, 3, 3))[:, index],
            batch[schema.CAMERA_EXTRINSICS].unflatten(-1, (5, 4, 4))[:, index],
        )
        assert torch.equal(whole, expected)
        holed, lost = batch[key].clone(), torch.zeros_like(batch[key], dtype=torch.bool)
        holed[..., 3:6, 2:9] = torch.tensor([[0.0], [torch.nan], [10.0]])
        lost[..., 3:6, 2:9] = True
        points = observe(batch | {key: holed}, cameras=(camera,), keypose_horizon=5).points
        lost = lost.flatten(2).expand_as(points)
        assert points[lost].isnan().all()
        assert torch.equal(points[~lost], whole[~lost])

"""Policies look before they act: what cannot be true is one clear error, what is unlike the training a warning."""

import logging
import re

import pandas as pd
import pytest
import torch
from lerobot.configs import FeatureType, PolicyFeature, PreTrainedConfig
from lerobot.policies.factory import get_policy_class

from lerobot_bimanual.cameras import CAMERA_NAMES
from lerobot_bimanual.cameras_torch import unproject
from lerobot_bimanual.dataset.schema import (
    CAMERA_EXTRINSICS,
    CAMERA_INTRINSICS,
    GRIPPER_FINGERS,
    KEYPOSE_STEP,
    NEXT_KEYPOSE,
    STATE,
    depth_key,
    image_key,
)
from lerobot_policy_bimanual import PerAct2Config
from lerobot_policy_bimanual.errors import BadObservation
from lerobot_policy_bimanual.keypose.observation import observe
from lerobot_policy_bimanual.keypose.observation_check import ObservationCheck

RGB, DEPTH = image_key("front"), depth_key("front")


def scaled(key, factor):
    return lambda batch: batch.update({key: batch[key] * factor})


def filled(key, value):
    return lambda batch: batch.update({key: torch.full_like(batch[key], value)})


def without(*keys):
    return lambda batch: [batch.pop(key) for key in keys]


def put(**changes):
    names = {"rgb": RGB, "depth": DEPTH, "state": STATE, "fingers": GRIPPER_FINGERS, "step": KEYPOSE_STEP}
    names |= {"extrinsics": CAMERA_EXTRINSICS, "intrinsics": CAMERA_INTRINSICS, "task": "task"}

    def change(batch):
        for name, new in changes.items():
            batch[names[name]] = new(batch[names[name]])

    return change


def no_number_in(key, at):
    def change(batch):
        batch[key][0, at] = torch.nan

    return change


def all_depths(change):
    return lambda batch: batch.update({depth_key(c): change(batch[depth_key(c)]) for c in CAMERA_NAMES})


WRONG = {
    "no depth": (without(*map(depth_key, CAMERA_NAMES)), r"front_depth.*--env\.obs=rgbd.*--rename_map"),
    "no camera": (
        without(RGB, DEPTH),
        r"lacks observation\.images\.front, .*--env\.cameras=front,left_should",
    ),
    "no calibration": (without(CAMERA_INTRINSICS), "lacks observation.camera_intrinsics"),
    "no instruction": (without("task"), "lacks task, "),
    "one instruction for all": (put(task=lambda _: "lift the ball"), "'lift the ball', but must be a list"),
    "an instruction too few": (put(task=lambda task: task[:1]), "as there are 1 instructions"),
    "no sample": (put(task=lambda _: []), "as there are 0 instructions"),
    "RGB to 255": (scaled(RGB, 255), "to 25.*divide 0..255 by 255"),
    "RGB in bytes": (put(rgb=lambda rgb: (rgb * 255).to(torch.uint8)), r"torch\.uint8, but must hold floats"),
    "one pixel of RGB that is NaN": (no_number_in(RGB, (0, 0, 0)), "goes from nan"),
    "channels last": (put(rgb=lambda rgb: rgb.permute(0, 2, 3, 1)), r"of the shape \(2, 3, 16, 3\)"),
    "depth without its channel": (put(depth=lambda depth: depth[:, 0]), r"of the shape \(2, 1, 16, 16\)"),
    "no pixels": (put(rgb=lambda rgb: rgb[..., :0], depth=lambda d: d[..., :0]), r"\(2, 3, 16, 0\)"),
    "depth of another size": (put(depth=lambda depth: depth[..., ::2, ::2]), "must be aligned to colour"),
    "images of another size than the intrinsics": (
        put(rgb=lambda rgb: rgb[..., :12, :12], depth=lambda depth: depth[..., :12, :12]),
        "12 x 12 pixels, but .* row 8, column 8: scale both together",
    ),
    "depth in metres": (scaled(DEPTH, 1e-3), "must be in millimetres.*depth_output_unit=m"),
    "depth in metres in whole numbers": (put(depth=lambda d: (d / 1000).to(torch.uint16)), "in millimetres"),
    "depth below zero": (put(depth=lambda depth: depth - 1000), "goes from -"),
    "all cameras off": (all_depths(torch.zeros_like), "no camera has any depth"),
    "all cameras without numbers": (all_depths(lambda depth: depth * torch.nan), "no camera has any depth"),
    "all cameras off in one sample": (
        all_depths(lambda depth: depth * torch.tensor([1.0, 0])[:, None, None, None]),
        "no camera has any depth",
    ),
    "a joint that is no number": (no_number_in(STATE, 3), "observation.state holds NaN"),
    "a state of another robot": (put(state=lambda state: state[:, :7]), r"of the shape \(2, 16\)"),
    "calibration that is no number": (no_number_in(CAMERA_EXTRINSICS, 3), "camera_extrinsics holds NaN"),
    "numbers in a list": (put(state=lambda state: state.tolist()), "is a list of the shape"),
}


def test_what_cannot_be_true_is_one_clear_line_also_after_the_first_call(make_policy, make_batch):
    policy = make_policy()
    policy.select_action(make_batch())
    said = {}
    for wrong, (change, message) in WRONG.items():
        batch = make_batch()
        change(batch)
        for use in (policy.select_action, policy.train().forward, policy.eval().forward):
            try:
                use(batch)
                said[wrong] = "nothing"
            except BadObservation as error:
                if not re.search(message, str(error)) or "\n" in str(error):
                    said[wrong] = str(error)
    assert not said


FINE = {
    "depth in 16 bits": put(depth=lambda depth: depth.to(torch.uint16)),
    "depth in 32 bits": put(depth=lambda depth: depth.to(torch.int32), rgb=lambda rgb: rgb.double()),
    "pixels that are no number": put(depth=lambda depth: torch.where(depth > 900, torch.nan, depth)),
    "pixels of zero": put(depth=lambda depth: torch.where(depth > 900, 0, depth)),
    "pixels that a dataset stores as not measured": put(
        depth=lambda depth: torch.where(depth > 900, 10, depth)
    ),
    "a bit above one": put(rgb=lambda rgb: rgb * 1.009),
    "other containers": put(task=tuple, step=lambda step: step[:, 0]),
}


def test_other_kinds_of_numbers_and_pixels_without_depth_are_fine(make_policy, make_batch, caplog):
    policy = make_policy()
    for change in FINE.values():
        batch = make_batch()
        change(batch)
        assert torch.isfinite(policy.select_action(batch)).all()
    assert torch.isfinite(policy.train()(batch)[0])
    assert not caplog.records


def warnings_of(caplog) -> list[str]:
    return [record.getMessage() for record in caplog.records if record.levelno == logging.WARNING]


UNUSUAL = [
    (filled(DEPTH, 0), "front_depth has no depth at all"),
    (filled(DEPTH, torch.nan), "front_depth has no depth at all"),
    (filled(DEPTH, 10), "front_depth has no depth at all"),
]


def test_what_may_happen_to_a_robot_is_a_warning_once(policy_type, specimens, make_batch, caplog):
    options = next(iter(specimens[policy_type].tiny.values()))
    policy = get_policy_class(policy_type)(PreTrainedConfig.get_choice_class(policy_type)(**options))
    for change, message in UNUSUAL:
        policy._check_observation = ObservationCheck(policy.config)  # one that has not warned yet
        caplog.clear()
        batch = make_batch()
        change(batch)
        for _ in range(2):
            assert torch.isfinite(policy.select_action(batch)).all()
        assert len(warnings_of(caplog)) == 1
        assert message in caplog.text


class Meta:
    """What LeRobot says of a dataset, as far as a policy looks."""

    def __init__(self, instructions, height, width):
        self.tasks = pd.DataFrame({"task_index": range(len(instructions))}, index=list(instructions))
        names = ["height", "width", "channels"]
        self.features = {
            key: {"dtype": "image", "shape": (height, width, channels), "names": names}
            for camera in CAMERA_NAMES
            for key, channels in ((image_key(camera), 3), (depth_key(camera), 1))
        }
        self.stats = {}


def train_on(policy, **meta):
    policy.config.input_features = {
        key: PolicyFeature(FeatureType.VISUAL, (3, 8, 8)) for key in policy.config.observation_keys
    }
    policy.config.remember_dataset(Meta(**meta))


def test_another_task_and_another_size_are_warned_of_once_and_survive_saving(
    make_policy, make_batch, caplog, tmp_path
):
    policy = make_policy()
    train_on(policy, instructions=["push the box"], height=32, width=24)
    policy.save_pretrained(tmp_path)
    restored = type(policy).from_pretrained(tmp_path)
    assert restored.config.trained_instructions == ("push the box",)
    for _ in range(2):
        restored.select_action(make_batch())
    size, task = warnings_of(caplog)
    assert re.search(r"images of 32 x 24 .*front has 16 x 16.*--env\.image_size=32x24", size)
    assert re.search(r"never trained with 'lift the ball 0', but with 'push the box': .*--env\.task", task)


@pytest.mark.parametrize("instructions", [map(str, range(5000)), ["very " * 3000 + "long"]])
def test_datasets_with_endless_instructions_are_not_remembered(instructions):
    config = PerAct2Config(device="cpu")
    config.remember_dataset(Meta(list(instructions), 16, 16))
    assert config.trained_instructions == ()


def test_labels_are_not_looked_at_when_acting(make_policy, make_batch):
    batch = make_batch()
    batch[NEXT_KEYPOSE] = "no label at all"
    assert torch.isfinite(make_policy().select_action(batch)).all()


@pytest.mark.parametrize("nothing", [0.0, torch.nan, 10.0])
def test_what_was_not_measured_is_no_point(make_batch, nothing):
    batch = make_batch()
    key = depth_key("front")
    is_lost = torch.zeros_like(batch[key], dtype=torch.bool)
    is_lost[..., 3:7, 2:9] = True
    whole = observe(batch, cameras=("front",), keypose_horizon=5).points
    batch[key] = torch.where(is_lost, nothing, batch[key])
    points = observe(batch, cameras=("front",), keypose_horizon=5).points
    lost = is_lost.flatten(2).expand_as(points)
    assert points[lost].isnan().all()
    assert torch.equal(points[~lost], whole[~lost])


def test_what_was_measured_is_where_it_was_bit_for_bit(make_batch):
    batch = make_batch()
    for camera in CAMERA_NAMES:
        index, depth_mm = CAMERA_NAMES.index(camera), batch[depth_key(camera)]
        batch[depth_key(camera)] = depth_mm.clamp(min=11)  # the next that a dataset can store
        expected = unproject(
            batch[depth_key(camera)][:, 0] / 1000,
            batch[CAMERA_INTRINSICS].unflatten(-1, (5, 3, 3))[:, index],
            batch[CAMERA_EXTRINSICS].unflatten(-1, (5, 4, 4))[:, index],
        )
        assert torch.equal(observe(batch, cameras=(camera,), keypose_horizon=5).points, expected)

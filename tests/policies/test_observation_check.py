"""Policies look before they act: what cannot be true is one clear error, what is unlike the training a warning."""

import logging
import re
import time

import pandas as pd
import pytest
import torch
from lerobot.configs import FeatureType, PolicyFeature, PreTrainedConfig
from lerobot.policies.factory import get_policy_class

from lerobot_bimanual.cameras import CAMERA_NAMES
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
from lerobot_policy_bimanual.peract.voxel_grid import voxelise

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
        r"lacks observation\.images\.front, .*--env\.cameras=front,left_shoulder",
    ),
    "no calibration": (without(CAMERA_INTRINSICS), "lacks observation.camera_intrinsics.*--rename_map"),
    "no state": (without(STATE), "lacks observation.state"),
    "no instruction": (without("task"), "lacks task, .*one instruction per sample"),
    "one instruction for all": (
        put(task=lambda _: "lift the ball"),
        "`task` is 'lift the ball', but must be a list",
    ),
    "an empty instruction": (put(task=lambda _: ["", ""]), "in words per sample"),
    "an instruction too few": (
        put(task=lambda task: task[:1]),
        r"shape \(2, 3, 16, 16\), but must have \(1, 3",
    ),
    "no sample": (put(task=lambda _: []), "must be a list"),
    "RGB to 255": (scaled(RGB, 255), "to 25.*divide 0..255 by 255"),
    "RGB in bytes": (
        put(rgb=lambda rgb: (rgb * 255).to(torch.uint8)),
        r"torch\.uint8, but RGB must be floats",
    ),
    "RGB around zero": (put(rgb=lambda rgb: rgb * 2 - 1), "but RGB must be from 0 to 1"),
    "RGB that is none": (filled(RGB, torch.nan), "goes from nan to nan"),
    "one pixel of RGB that is none": (no_number_in(RGB, (0, 0, 0)), "goes from nan"),
    "channels last": (put(rgb=lambda rgb: rgb.permute(0, 2, 3, 1)), r"must have \(2, 3, height, width\)"),
    "three channels of depth": (
        put(depth=lambda depth: depth.expand(-1, 3, -1, -1)),
        r"must have \(2, 1, height",
    ),
    "depth without its channel": (put(depth=lambda depth: depth[:, 0]), r"must have \(2, 1, height"),
    "no pixels": (put(rgb=lambda rgb: rgb[..., :0], depth=lambda d: d[..., :0]), "height, width"),
    "other batches": (put(depth=lambda depth: depth[:1]), r"shape \(1, 1, 16, 16\)"),
    "depth of another size": (put(depth=lambda depth: depth[..., ::2, ::2]), "align depth to colour"),
    "images of another size than the intrinsics": (
        put(rgb=lambda rgb: rgb[..., :12, :12], depth=lambda depth: depth[..., :12, :12]),
        "12 pixels wide, but .* middle at 8, as an image of 16",
    ),
    "depth in metres": (scaled(DEPTH, 1e-3), "must be in millimetres.*depth_output_unit=m"),
    "depth in metres in whole numbers": (put(depth=lambda d: (d / 1000).to(torch.uint16)), "in millimetres"),
    "depth below zero": (put(depth=lambda depth: depth - 1000), "goes down to -"),
    "depth minus infinity": (filled(DEPTH, -torch.inf), "goes down to -"),
    "all cameras off": (all_depths(torch.zeros_like), "no camera has any depth"),
    "all cameras without numbers": (all_depths(lambda depth: depth * torch.nan), "no camera has any depth"),
    "all cameras infinitely far": (all_depths(lambda depth: depth * torch.inf), "no camera has any depth"),
    "all cameras off in one sample": (
        all_depths(lambda depth: depth * torch.tensor([1.0, 0])[:, None, None, None]),
        "no camera has any depth",
    ),
    "a joint that is no number": (no_number_in(STATE, 3), "observation.state holds nan"),
    "a finger that is no number": (no_number_in(GRIPPER_FINGERS, 0), "gripper_fingers holds nan"),
    "fingers in millimetres": (scaled(GRIPPER_FINGERS, 1000), "must be in metres"),
    "openings in percent": (scaled(STATE, 100), r"must be from 0 \(closed\) to 1"),
    "a step before the first": (filled(KEYPOSE_STEP, -1), "counts the keyposes"),
    "a state of another robot": (put(state=lambda state: state[:, :7]), r"must have \(2, 16\)"),
    "calibration of one camera": (put(intrinsics=lambda k: k[:, :9]), r"must have \(2, 45\)"),
    "calibration that is no number": (no_number_in(CAMERA_EXTRINSICS, 3), "of front holds nan"),
    "calibration of zeros": (filled(CAMERA_EXTRINSICS, 0), "of front is no pose"),
    "calibration column by column": (
        put(extrinsics=lambda e: e.unflatten(1, (5, 4, 4)).transpose(2, 3).flatten(1)),
        "last row 0 0 0 1",
    ),
    "a mirrored camera": (
        put(extrinsics=lambda e: e * torch.tensor([-1.0, 1, 1, 1]).repeat(20)),
        "is no pose",
    ),
    "lenses of zeros": (filled(CAMERA_INTRINSICS, 0), "must be above 0, in pixels"),
    "numbers in a list": (put(state=lambda state: state.tolist()), "is a list, but must be a tensor"),
    "complex numbers": (put(depth=lambda depth: depth.to(torch.complex64)), "plain numbers"),
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
    "half numbers": put(rgb=lambda rgb: rgb.half(), depth=lambda depth: depth.half()),
    "pixels that are no number": put(depth=lambda depth: torch.where(depth > 900, torch.nan, depth)),
    "pixels of zero": put(depth=lambda depth: torch.where(depth > 900, 0, depth)),
    "pixels that a dataset stores as not measured": put(
        depth=lambda depth: torch.where(depth > 900, 10, depth)
    ),
    "a bit above one": put(rgb=lambda rgb: rgb * 1.009),
    "other containers": put(task=tuple, step=lambda step: step[:, 0]),
    "double numbers": put(state=lambda state: state.double(), intrinsics=lambda k: k.double()),
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
    (filled(RGB, 0), "front is black"),
    (scaled(RGB, 1 / 255), "divided by 255 twice"),
    (all_depths(lambda depth: depth * 100), "no camera sees anything inside the workspace"),
    (lambda batch: batch[CAMERA_EXTRINSICS].view(2, 5, 4, 4)[..., 0, 3].fill_(50), "acts blindly"),
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


def test_a_checkpoint_on_its_own_task_and_size_says_nothing(make_policy, make_batch, caplog):
    policy = make_policy()
    batch = make_batch()
    train_on(policy, instructions=batch["task"], height=16, width=16)
    policy.select_action(batch)
    assert not caplog.records


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
    assert re.search(r"images of 32 x 24 .* front has 16 x 16.*--env\.image_size=32x24", size)
    assert re.search(r"never trained to 'lift the ball 0', but with 'push the box': .*--env\.task", task)


def test_a_policy_is_told_of_its_dataset_when_it_is_made_for_training(make_policy, make_batch):
    policy = make_policy()
    made = type(policy)(policy.config, dataset_meta=Meta(["lift the ball"], 16, 16))
    assert made.config.trained_instructions == ("lift the ball",)
    again = type(policy)(policy.config, dataset_meta=Meta(["push the box", "push it"], 16, 16))
    assert again.config.trained_instructions == ("push the box", "push it")


@pytest.mark.parametrize("instructions", [map(str, range(5000)), ["very " * 1000 + "long"]])
def test_datasets_with_endless_instructions_are_not_remembered(instructions):
    config = PerAct2Config(device="cpu")
    config.remember_dataset(Meta(list(instructions), 16, 16))
    assert config.trained_instructions == ()


def test_checkpoints_from_before_know_no_task_and_are_played_without_a_word(make_policy, make_batch, caplog):
    policy = make_policy()
    assert policy.config.trained_instructions == ()
    policy.select_action(make_batch())
    assert not caplog.records


def test_looking_costs_less_than_seeing(make_batch):
    config = PerAct2Config(device="cpu", keypose_horizon=25)
    check = ObservationCheck(config)
    batch = make_batch(samples=1, size=128)

    def seconds(work) -> float:
        times = []
        for _ in range(5):
            start = time.process_time()
            work()
            times.append(time.process_time() - start)
        return min(times)

    def see():
        seen = observe(batch, cameras=config.cameras, keypose_horizon=25)
        voxelise(seen.points, seen.colours, workspace=config.workspace, voxels=25)

    assert seconds(lambda: check(batch)) < seconds(see)


def test_labels_are_not_looked_at_when_acting(make_policy, make_batch):
    batch = make_batch()
    batch[NEXT_KEYPOSE] = "no label at all"
    assert torch.isfinite(make_policy().select_action(batch)).all()

"""Generated datasets are complete, reproducible, true to the environment, and survive crashes."""

import os
import re
from dataclasses import asdict, replace

import numpy as np
import pytest
from lerobot.datasets.lerobot_dataset import LeRobotDataset
from lerobot_env_bimanual.generation.candidates import Shard, ShardReport, next_round
from lerobot_env_bimanual.generation.merging import merge_shards
from lerobot_env_bimanual.generation.shards import make_recorder, record_shard

from lerobot_bimanual.dataset import schema
from lerobot_bimanual.dataset.provenance import Recipe, SkippedSeed, installed_versions
from lerobot_bimanual.dataset.reader import RecordedDataset
from lerobot_bimanual.errors import BimanualError, DatasetError
from lerobot_env_bimanual.commands.generate import generate, regeneration_command
from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.episode.observations import env_key
from lerobot_env_bimanual.expert.recorder import Recorder
from lerobot_env_bimanual.generation.executor import MergeJob
from lerobot_env_bimanual.generation.settings import GenerationSettings
from lerobot_env_bimanual.generation.staging import Staging

pytestmark = pytest.mark.sim


def settings_of(config, **changes) -> GenerationSettings:
    return GenerationSettings.from_dict(GenerationSettings.parse(config).to_dict() | changes)


# -- what a dataset holds ---------------------------------------------------------------------------------


def test_both_views_hold_the_same_episodes_in_the_order_of_their_seeds(generated) -> None:
    frames, keyframes = (RecordedDataset(generated / view) for view in schema.VIEWS)
    assert len(frames) == len(keyframes) == 3
    for index in range(3):
        every_tick, some_ticks = frames.episode(index), keyframes.episode(index)
        assert every_tick.meta == some_ticks.meta
        assert (every_tick.meta.task, every_tick.meta.split, every_tick.meta.seed) == (
            "lift_ball",
            "train",
            index,
        )
        ticks = some_ticks.columns[schema.TICK]
        assert ticks[0] == 0
        assert ticks[-1] == len(every_tick)
        for key in (schema.STATE, schema.ACTION, schema.NEXT_KEYPOSE, schema.STATE_HASH, schema.KEYPOSE_STEP):
            assert np.array_equal(some_ticks.columns[key][:-1], every_tick.columns[key][ticks[:-1]]), key


def test_keyframes_are_the_stages_of_the_expert_with_the_asked_rows_between(generated) -> None:
    frames, keyframes = (RecordedDataset(generated / view).episode(0) for view in schema.VIEWS)
    steps = frames.columns[schema.KEYPOSE_STEP]
    starts = {0, *(np.flatnonzero(np.diff(steps)) + 1)}
    stages = len(starts)
    assert stages > 1
    stored = set(keyframes.columns[schema.TICK].tolist())
    assert starts < stored
    assert len(stored) == 2 * stages + 1
    flagged = keyframes.columns[schema.TICK][keyframes.columns[schema.KEYFRAME]]
    assert set(flagged.tolist()) == (starts - {0}) | {len(frames)}


def test_the_dataset_shows_what_the_environment_shows(generated) -> None:
    cameras = ("front", "left_wrist")
    keyframes = LeRobotDataset("local/small", root=generated / "keyframes")
    recorded = RecordedDataset(generated / "frames").episode(1)
    rows = [i for i, index in enumerate(keyframes.hf_dataset["episode_index"]) if index == 1]
    items = {int(item["tick"]): item for i in rows if isinstance(item := keyframes[i], dict)}
    env = BimanualEnv("lift_ball", 0, "train", cameras, (24, 32), control_mode="joint")
    observation, _ = env.reset(seed=recorded.meta.seed)
    for tick, action in enumerate(recorded.columns[schema.ACTION]):
        if tick in items:
            assert_same_observation(items[tick], observation, cameras)
        observation, *_ = env.step(action)
    assert_same_observation(items[len(recorded)], observation, cameras)
    env.close()


def assert_same_observation(item: dict, observation: dict, cameras: tuple[str, ...]) -> None:
    for camera in cameras:
        rgb = np.moveaxis(item[schema.image_key(camera)].numpy() * 255, 0, -1)
        assert np.array_equal(np.rint(rgb), observation["pixels"][camera])
        depth_mm = observation[env_key(schema.depth_key(camera))]
        assert np.abs(item[schema.depth_key(camera)].numpy() - depth_mm).max() < 1
    for key in (schema.STATE, schema.EE_POSE, schema.CAMERA_EXTRINSICS, schema.CAMERA_INTRINSICS):
        assert np.array_equal(item[key], observation[env_key(key)]), key


def test_provenance_says_how_to_make_the_dataset_again(generated, small_generation) -> None:
    settings = GenerationSettings.parse(small_generation(generated))
    for view in schema.VIEWS:
        provenance = RecordedDataset(generated / view).provenance
        assert provenance is not None
        assert GenerationSettings.from_dict(provenance.settings) == settings
        assert provenance.versions == installed_versions()
        assert provenance.view == view
        assert [recipe.seed for recipe in provenance.episodes] == [0, 1, 2]
        assert provenance.command == regeneration_command(settings, generated)
        assert provenance.command in (generated / view / "README.md").read_text()


def test_any_process_with_any_history_writes_the_same_bytes(
    generated, small_generation, tree_hashes, tmp_path
) -> None:
    config = small_generation(tmp_path / "small")
    settings = GenerationSettings.parse(config)
    recorder = make_recorder(settings, "lift_ball")
    shards = []
    with Staging(config.root, settings) as staging:
        for shard in reversed(next_round(settings, [], 0)):  # the other order
            record_shard(settings, shard, recorder, staging.shard_folder(shard.name), lambda: None)
            shards.insert(0, (staging.shard_folder(shard.name), staging.report(shard)))
        recorder.close()
        command = regeneration_command(settings, config.root)
        for view in settings.views:
            merge_shards(MergeJob(settings, view, command, shards, tmp_path / "merged", tmp_path / "cache"))
        staging.publish(tmp_path / "merged")
    assert tree_hashes(config.root) == tree_hashes(generated)


def test_a_single_view_lies_in_the_root_itself(generated, small_generation, tmp_path, capsys) -> None:
    config = small_generation(tmp_path / "one", view="keyframes", episodes=1, discretise=100)
    generate(config)
    summary = re.search(r"([\d.]+) minutes, ([\d.]+) of CPU time; ([\d.]+) MB", capsys.readouterr().out)
    assert summary is not None
    assert all(float(number) > 0 for number in summary.groups())
    one, small = RecordedDataset(config.root).episode(0), RecordedDataset(generated / "keyframes").episode(0)
    assert one.meta == small.meta
    positions = one.columns[schema.NEXT_KEYPOSE][:, :3]
    assert not np.array_equal(positions, small.columns[schema.NEXT_KEYPOSE][:, :3])
    assert np.allclose((positions * 100) % 1, 0.5, atol=1e-3)  # centres of voxels of 1 cm


# -- once more ----------------------------------------------------------------------------------------------


def test_a_finished_dataset_stays_as_it_is(generated, small_generation, tree_hashes, capsys) -> None:
    before = tree_hashes(generated)
    assert generate(small_generation(generated)) is None
    assert "already complete" in capsys.readouterr().out
    assert tree_hashes(generated) == before
    assert [path.name for path in generated.parent.iterdir()] == [generated.name]


@pytest.mark.parametrize(
    ("change", "difference"),
    [
        ({"episodes": 4}, "episodes is 3, not 4"),
        ({"view": "frames"}, "views is .'frames', 'keyframes'., not .'frames',."),
        ({"first_seed": 7, "split": "val"}, "split is 'train', not 'val'; first_seed is 0, not 7"),
    ],
)
def test_other_settings_at_the_same_root_are_refused(generated, small_generation, change, difference) -> None:
    with pytest.raises(DatasetError, match=difference):
        generate(small_generation(generated, **change))


def test_a_folder_of_somebody_else_is_refused(tmp_path, small_generation) -> None:
    (tmp_path / "photos").mkdir()
    (tmp_path / "photos" / "cat.jpg").touch()
    with pytest.raises(DatasetError, match="was not made by this command"):
        generate(small_generation(tmp_path / "photos"))
    assert (tmp_path / "photos" / "cat.jpg").exists()


def test_two_runs_at_one_root_are_refused(tmp_path, small_generation) -> None:
    config = small_generation(tmp_path / "shared")
    with (
        Staging(config.root, GenerationSettings.parse(config)),
        pytest.raises(DatasetError, match=f"is being generated by process {os.getpid()}"),
    ):
        generate(config)


def test_an_unfinished_dataset_of_other_settings_or_versions_is_refused(tmp_path, small_generation) -> None:
    config = small_generation(tmp_path / "begun")
    settings = GenerationSettings.parse(config)
    with Staging(config.root, settings):
        pass
    with (
        pytest.raises(DatasetError, match="episodes is 3, not 5"),
        Staging(config.root, settings_of(config, episodes=5)),
    ):
        pass
    stamp = tmp_path / "begun.partial" / "settings.json"
    stamp.write_text(stamp.read_text().replace(installed_versions()["mujoco"], "1.2.3"))
    with pytest.raises(DatasetError, match=r"'mujoco': '1\.2\.3'"), Staging(config.root, settings):
        pass


def test_leftovers_of_killed_runs_are_removed(tmp_path, small_generation) -> None:
    config = small_generation(tmp_path / "killed")
    settings = GenerationSettings.parse(config)
    with Staging(config.root, settings) as staging:
        (staging.folder / "tmp-123" / "frames").mkdir(parents=True)
    with Staging(config.root, settings) as staging:
        assert not list(staging.folder.glob("tmp-*"))


def test_a_place_that_cannot_be_written_is_one_clear_error(tmp_path, small_generation) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(DatasetError, match=r"cannot write .*Not a directory"):
        generate(small_generation(tmp_path / "file" / "dataset"))


# -- which seeds --------------------------------------------------------------------------------------------


def candidates(shards: list[Shard]) -> list[tuple[int, int]]:
    return [(candidate.seed, candidate.variation) for shard in shards for candidate in shard.candidates]


def report(shards: list[Shard], failing: set[int]) -> list[ShardReport]:
    return [
        ShardReport(
            tuple(c for c in shard.candidates if c.seed not in failing),
            tuple(SkippedSeed(**asdict(c), reason="slipped") for c in shard.candidates if c.seed in failing),
        )
        for shard in shards
    ]


def test_seeds_follow_each_other_and_variations_take_turns(tmp_path, small_generation, monkeypatch) -> None:
    monkeypatch.setattr(GenerationSettings, "variations_of", lambda *_: (0, 1, 2))
    settings = settings_of(small_generation(tmp_path), episodes=5, first_seed=10)
    shards = next_round(settings, [], 0)
    assert candidates(shards) == [(10, 0), (11, 1), (12, 2), (13, 0), (14, 1)]
    assert [(shard.name, len(shard.candidates)) for shard in shards] == [
        ("000000", 2),
        ("000001", 2),
        ("000002", 1),
    ]


def test_a_failed_seed_is_replaced_by_the_next_one_of_its_variation(
    tmp_path, small_generation, monkeypatch
) -> None:
    monkeypatch.setattr(GenerationSettings, "variations_of", lambda *_: (0, 1))
    settings = settings_of(small_generation(tmp_path), episodes=4)
    first = next_round(settings, [], 0)
    reports = report(first, failing={1, 3, 5})
    second = next_round(settings, reports, len(first))
    assert candidates(second) == [(5, 1), (7, 1)]
    assert second[0].name == f"{len(first):06d}"
    reports += report(second, failing={1, 3, 5})
    third = next_round(settings, reports, len(first) + len(second))
    assert candidates(third) == [(9, 1)]
    assert next_round(settings, reports + report(third, failing=set()), 9) == []


def test_an_expert_that_keeps_failing_stops_the_generation(tmp_path, small_generation) -> None:
    settings = settings_of(small_generation(tmp_path), episodes=1)
    failures = tuple(SkippedSeed("lift_ball", 0, "train", seed, "slipped") for seed in range(21))
    with pytest.raises(DatasetError, match=r"failed on 21 seeds.*seed 20: slipped"):
        next_round(settings, [ShardReport((), failures)], 1)


class HalfBrokenRecorder(Recorder):
    """Fails on odd seeds, otherwise plays the expert."""

    def record(self, seed: int, variation: int):
        outcome, episode = super().record(seed, variation)
        if seed % 2:
            return replace(outcome, failure="out of time", unmet=("lifted",)), None
        return outcome, episode


def test_skipped_seeds_are_recorded_with_their_reason(tmp_path, small_generation) -> None:
    settings = settings_of(small_generation(tmp_path / "x"), views=("keyframes",))
    shard = Shard("000000", tuple(Recipe("lift_ball", 0, "train", seed) for seed in (1, 2)))
    with Staging(tmp_path / "x", settings) as staging:
        counted = []
        recorder = HalfBrokenRecorder("lift_ball", "train", settings.cameras, (24, 32))
        folder = staging.shard_folder(shard.name)
        record_shard(settings, shard, recorder, folder, lambda: counted.append(1))
        found = staging.report(shard)
        assert found is not None
        assert (found.episodes, len(counted)) == ((shard.candidates[1],), 1)
        assert [seed.seed for seed in found.skipped] == [1]
        assert "out of time" in found.skipped[0].reason
        assert "lifted" in found.skipped[0].reason
        assert [episode.meta.seed for episode in RecordedDataset(folder / "keyframes").episodes()] == [2]
        assert not list(staging.folder.glob("tmp-*"))


@pytest.mark.parametrize(
    "change",
    [
        {"task": "wash_dishes"},
        {"variation": "9"},
        {"cameras": ("rear",)},
        {"image_size": "0"},
        {"episodes": 0},
        {"intermediate": ("1.5",)},
        {"intermediate": ("half",)},
        {"view": "all"},
        {"split": "exam"},
    ],
)
def test_wrong_options_are_refused_before_anything_is_made(tmp_path, small_generation, change) -> None:
    with pytest.raises(BimanualError):
        generate(small_generation(tmp_path / "never", **change))
    assert not list(tmp_path.iterdir())

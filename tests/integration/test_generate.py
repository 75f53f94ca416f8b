"""Generated datasets are complete, reproducible, true to the environment, and survive crashes."""

import runpy
import shlex
from collections import Counter
from collections.abc import Collection
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from lerobot.datasets.lerobot_dataset import LeRobotDataset

from lerobot_bimanual.cli.flags import parse_flags
from lerobot_bimanual.dataset import schema
from lerobot_bimanual.dataset.hub import check_repo_id
from lerobot_bimanual.dataset.provenance import SkippedSeed
from lerobot_bimanual.dataset.reader import RecordedDataset
from lerobot_bimanual.distributions import installed_versions
from lerobot_bimanual.errors import DatasetError, InvalidChoice
from lerobot_env_bimanual.commands.dataset_generate import (
    DatasetGenerateConfig,
    dataset_generate,
    make_dataset,
    settings_of,
)
from lerobot_env_bimanual.commands.dataset_verify import DatasetVerifyConfig, dataset_verify
from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.episode.observations import env_key
from lerobot_env_bimanual.experts.recorder import Recorder
from lerobot_env_bimanual.generation.plan import ShardReport, next_round
from lerobot_env_bimanual.generation.settings import repo_id_of
from lerobot_env_bimanual.options import EnvOptions


def test_both_views_hold_the_same_episodes_and_keyframes_has_one_more_row_within_each_stage(generated):
    frames, keyframes = (RecordedDataset(generated / view).episodes() for view in schema.VIEWS)
    for every_tick, some_ticks in zip(frames, keyframes, strict=True):
        assert some_ticks.meta == every_tick.meta
        ticks = some_ticks.columns[schema.TICK]
        starts = {0, *(np.flatnonzero(np.diff(every_tick.columns[schema.KEYPOSE_STEP])) + 1)}
        assert len(ticks) == 2 * len(starts) + 1  # with one row on the way to each keypose, and the last one
        flagged = ticks[some_ticks.columns[schema.KEYFRAME]]
        assert {*flagged} == (starts - {0}) | {len(every_tick)}


def test_videos_have_the_file_permissions_of_the_other_files(generated):
    usual = (generated / "frames/meta/info.json").stat().st_mode
    assert {path.stat().st_mode for path in generated.rglob("*.mp4")} == {usual}


def test_the_dataset_shows_what_the_environment_shows(generated) -> None:
    cameras = ("front", "left_wrist")
    keyframes = LeRobotDataset("local/small", root=generated / "keyframes")
    dataset = RecordedDataset(generated / "frames")
    recorded = dataset.episode(1)
    rows = [i for i, index in enumerate(keyframes.hf_dataset["episode_index"]) if index == 1]
    items = {int(item["tick"]): item for i in rows if isinstance(item := keyframes[i], dict)}
    options = {"cameras": cameras, "image_size": (24, 32), "control_mode": "joint"}
    env = BimanualEnv("lift_ball", variation=0, split="train", **options)
    observation, _ = env.reset(seed=recorded.meta.seed)
    for tick, action in enumerate([*recorded.columns[schema.ACTION], None]):
        if (item := items.get(tick)) is not None:
            for camera in cameras:
                rgb = np.moveaxis(item[schema.image_key(camera)].numpy() * 255, 0, -1)
                assert np.array_equal(np.rint(rgb), observation["pixels"][camera])
                depth_mm = observation[env_key(schema.depth_key(camera))]
                assert np.abs(item[schema.depth_key(camera)].numpy() - depth_mm).max() < 1
            seen = dataset.calibration.row_without_calibration(
                {key: observation[env_key(key)] for key in schema.VECTORS}
            )
            for key in (schema.STATE, schema.EE_POSE, schema.WRIST_EXTRINSICS):
                assert np.array_equal(item[key], seen[key]), key
        if action is not None:
            observation, *_ = env.step(action)
    assert len(recorded) in items


@pytest.mark.parametrize(
    ("folder", "repo_id"),
    [
        *(("lift ball", "local/lift_ball"), (".x", "local/x"), ("v1--Ω", "local/v1__")),
        *(("-", "local/dataset"), ("x.git", "local/x_git"), ("x" * 100, f"local/{'x' * 80}")),
    ],
)
def test_every_folder_gives_a_name_that_the_hub_allows(folder, repo_id) -> None:
    assert repo_id_of(None, Path(folder)) == repo_id
    check_repo_id(repo_id)


def test_provenance_says_how_to_make_the_dataset_again(generated, small_generation) -> None:
    settings = settings_of(small_generation(generated))
    for view in schema.VIEWS:
        provenance = RecordedDataset(generated / view).provenance
        assert provenance is not None
        assert provenance.settings == settings.model_dump(mode="json")
        assert provenance.versions == installed_versions()
        assert provenance.view == view
        assert [key.seed for key in provenance.episodes] == [0, 1, 2]
        assert provenance.command in (generated / view / "README.md").read_text()
        program, group, leaf, *flags = shlex.split(provenance.command)
        assert (program, group, leaf) == ("lerobot-bimanual", "dataset", "generate")
        assert settings_of(parse_flags(DatasetGenerateConfig, flags)) == settings


def test_any_process_with_any_history_writes_the_same_bytes(
    generated, small_generation, records_here, tree_hashes, tmp_path
) -> None:
    config = small_generation(tmp_path / "small")
    executor = records_here(order=reversed)
    make_dataset(settings_of(config), config.root, executor)
    assert executor.recorded == ["000001", "000000"]
    assert tree_hashes(config.root) == tree_hashes(generated)


def test_a_single_view_lies_in_the_root_itself(generated, small_generation, tmp_path, capsys) -> None:
    config = small_generation(tmp_path / "one", view="keyframes", episodes=1, discretise=100)
    dataset_generate(config)
    said = capsys.readouterr()
    assert f"next: lerobot-bimanual dataset verify --root={config.root}" in said.err
    one, small = RecordedDataset(config.root).episode(0), RecordedDataset(generated / "keyframes").episode(0)
    assert one.meta == small.meta
    positions = one.columns[schema.ACTION][:, :3]
    assert not np.array_equal(positions, small.columns[schema.ACTION][:, :3])
    assert np.allclose((positions * 100) % 1, 0.5, atol=1e-3)  # centres of voxels of 1 cm


def test_a_finished_dataset_refuses_other_settings(generated, small_generation, tree_hashes, capsys):
    before = tree_hashes(generated)
    assert dataset_generate(small_generation(generated)) is None
    assert "already complete" in capsys.readouterr().out
    with pytest.raises(DatasetError, match=r"views is .'frames', 'keyframes'., not .'frames'."):
        dataset_generate(small_generation(generated, view="frames"))
    with pytest.raises(DatasetError, match="first_seed is 0, not 7; split is 'train', not 'val'"):
        dataset_generate(small_generation(generated, first_seed=7, split="val"))
    assert tree_hashes(generated) == before
    assert [path.name for path in generated.parent.iterdir()] == [generated.name]


def planned(config: DatasetGenerateConfig, failing: Collection[int] = ()) -> list[list[tuple[str, list]]]:
    """Name and (seed, variation) of the shards of each round, if the expert does not solve some seeds."""
    settings = settings_of(config)
    rounds: list[list[tuple[str, list]]] = []
    reports: list[ShardReport] = []
    while shards := next_round(settings, reports):
        rounds.append([(s.name, [(key.seed, key.variation) for key in s.candidates]) for s in shards])
        for shard in shards:
            failed = [key for key in shard.candidates if key.seed in failing]
            report = ShardReport(
                episodes=tuple(key for key in shard.candidates if key not in failed),
                skipped=tuple(SkippedSeed(**key.model_dump(), reason="slipped") for key in failed),
            )
            reports.append(report)
    return rounds


def test_variations_take_turns_and_a_failed_seed_is_replaced_by_its_next_one(tmp_path, small_generation):
    config = small_generation(tmp_path / "turns", task="handover_item", episodes=6, first_seed=10)
    (shards,) = planned(config)
    assert shards[:2] == [("000000", [(10, 0), (11, 1)]), ("000001", [(12, 2), (13, 3)])]
    assert shards[2:] == [("000002", [(14, 4), (15, 0)])]
    first, second, third = planned(replace(config, episodes=7, first_seed=0), failing={1, 6, 11, 3})
    assert [seed for _, candidates in first for seed, _ in candidates] == list(range(7))
    assert second == [("000004", [(8, 3), (11, 1)]), ("000005", [(16, 1)])]
    assert third == [("000006", [(21, 1)])]
    (shards,) = planned(replace(config, variation="1,4", episodes=3))
    assert [key for _, keys in shards for key in keys] == [(10, 1), (11, 4), (12, 1)]
    for wrong in ("1,any", "1,1", "1,01", "1,9"):
        with pytest.raises(InvalidChoice, match="variation"):
            settings_of(replace(config, variation=wrong))
    with pytest.raises(DatasetError, match=r"failed on 21 seeds.*seed 20: slipped"):
        planned(small_generation(tmp_path / "broken", episodes=1), failing=range(100))


def test_each_plan_is_demonstrated_in_the_same_scenes_whatever_seeds_are_skipped(tmp_path, small_generation):
    config = small_generation(tmp_path / "plans", task="dual_push_buttons", episodes=20, plans="several")
    skipped = {seed for seed in range(60) if seed % 3}
    candidates = [key for shards in planned(config, skipped) for _, keys in shards for key in keys]
    scenes = Counter((seed, variation) for seed, variation in candidates if seed not in skipped)
    assert {*scenes.values()} == {2}  # by each of the plans
    assert Counter(variation for _, variation in scenes) == dict.fromkeys(range(5), 2)


def test_skipped_seeds_are_listed_with_reasons(tmp_path, small_generation, records_here, monkeypatch, capsys):
    record = Recorder.record

    def fail_on_odd_seeds(recorder: Recorder, task: str, options: EnvOptions, seed: int, *others: Any):
        outcome, episode = record(recorder, task, options, seed, *others)
        if seed % 2 == 0:
            return outcome, episode
        return outcome.model_copy(update={"failure": "out of time", "unmet": ("lifted",)}), None

    monkeypatch.setattr(Recorder, "record", fail_on_odd_seeds)
    config = small_generation(tmp_path / "x", view="keyframes", episodes=1, first_seed=1)
    make_dataset(settings_of(config), config.root, records_here())
    dataset = RecordedDataset(config.root)
    assert [episode.meta.seed for episode in dataset.episodes()] == [2]
    assert dataset.provenance is not None
    (skipped,) = dataset.provenance.skipped
    assert skipped.seed == 1
    assert all(part in skipped.reason for part in ("out of time", "lifted"))
    assert skipped.reason in capsys.readouterr().out


def test_with_several_plans_a_column_says_which_is_followed(small_generation, tmp_path, records_here):
    options = {"plans": "several", "view": "keyframes", "episodes": 2, "episodes_per_shard": 2}
    config = small_generation(tmp_path / "several", **options)
    make_dataset(settings_of(config), config.root, records_here())
    dataset = RecordedDataset(config.root)
    assert dataset.provenance is not None
    first, second = dataset.episodes()
    assert first.meta == second.meta
    assert [set(episode.columns["plan"].tolist()) for episode in (first, second)] == [{0}, {1}]
    assert not np.array_equal(first.columns["action"][0], second.columns["action"][0])
    assert [key.plan for key in dataset.provenance.episodes] == [0, 1]
    assert dataset_verify(DatasetVerifyConfig(root=config.root, workers=1)) == 0
    assert dataset.provenance.settings["plans"] == "several"
    assert "plans" not in settings_of(replace(config, plans="one")).model_dump()  # as in datasets of old


EXAMPLE = Path(__file__).parents[2] / "examples/11_ray_cluster.py"


@pytest.mark.weekly
@pytest.mark.timeout(900)
def test_two_machines_give_the_dataset_of_one_process(
    generated, small_generation, tree_hashes, tmp_path, monkeypatch
) -> None:
    from ray.cluster_utils import Cluster

    monkeypatch.setenv("RAY_worker_niceness", "0")  # by default everything else on the machine goes first
    cluster = Cluster(initialize_head=True, head_node_args={"num_cpus": 1, "include_dashboard": False})
    try:
        cluster.add_node(num_cpus=1)
        root = tmp_path / generated.name
        monkeypatch.setenv("RAY_ADDRESS", cluster.address)
        config = small_generation(root)
        make_dataset(settings_of(config), root, runpy.run_path(str(EXAMPLE))["ray_executor"](0))
    finally:
        cluster.shutdown()
    assert tree_hashes(root) == tree_hashes(generated)
    assert [path.name for path in tmp_path.iterdir()] == [root.name]

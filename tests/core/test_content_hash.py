"""The content hash sees every value and every pixel, and nothing of the way they are stored."""

import shutil
from dataclasses import replace
from pathlib import Path

import pyarrow.parquet as pq
import pytest
from lerobot.datasets.aggregate import aggregate_datasets

from lerobot_bimanual.dataset import schema
from lerobot_bimanual.dataset.content_hash import EpisodeHash, combined_hash
from lerobot_bimanual.dataset.decoding import ImageReader
from lerobot_bimanual.dataset.reader import TASK_INDEX, RecordedDataset


def episode_hash(episode, images, units) -> str:
    digest = EpisodeHash(episode, units)
    for key, stream in images.items():
        for image in stream:
            digest.add_image(key, image)
    return digest.hexdigest()


def content_hash(root: Path) -> str:
    dataset, reader = RecordedDataset(root), ImageReader(root)
    images = [{key: reader.images(index, key) for key in reader.shapes} for index in range(len(dataset))]
    return combined_hash(
        episode_hash(episode, images[episode.index], reader.units) for episode in dataset.episodes()
    )


@pytest.mark.parametrize("view", schema.VIEWS)
@pytest.mark.parametrize("concatenate", [True, False])
def test_the_hash_does_not_depend_on_shards_and_files(
    datasets, write_view, tmp_path, view: schema.View, concatenate: bool
) -> None:
    parts = [write_view(tmp_path / str(seed), view, seed) for seed in (0, 1)]
    aggregate_datasets(
        ["local/part"] * 2,
        "local/whole",
        roots=parts,
        aggr_root=tmp_path / "whole",
        concatenate_videos=concatenate,
        concatenate_data=concatenate,
    )
    assert content_hash(tmp_path / "whole") == content_hash(datasets[view])


def test_the_hash_does_not_depend_on_the_form_of_the_table(datasets, tmp_path) -> None:
    root = tmp_path / "packed"
    shutil.copytree(datasets["keyframes"], root)
    (file,) = root.glob("data/*/*.parquet")
    table = pq.read_table(file)
    pq.write_table(
        table.select(sorted(table.column_names, reverse=True)), file, compression="zstd", row_group_size=3
    )
    assert content_hash(root) == content_hash(datasets["keyframes"])


def test_every_column_every_image_and_the_order_count(datasets) -> None:
    dataset, reader = RecordedDataset(datasets["keyframes"]), ImageReader(datasets["keyframes"])
    episode = dataset.episode(0)
    images = {key: list(reader.images(0, key)) for key in reader.shapes}
    units = reader.units
    hashes = [episode_hash(episode, images, units)]
    for key, column in episode.columns.items():
        other = column.copy()
        last = other[-1]
        other[-1] = f"{last}x" if other.dtype == object else ~last if other.dtype == bool else last + 1
        hashes.append(episode_hash(replace(episode, columns=episode.columns | {key: other}), images, units))
    for key, column in episode.bookkeeping.items():
        if key != TASK_INDEX:  # the number of a sentence depends on the sentences before it
            other = episode.bookkeeping | {key: column + 1}
            hashes.append(episode_hash(replace(episode, bookkeeping=other), images, units))
    told = replace(episode.meta, instruction="drop the ball")
    hashes.append(episode_hash(replace(episode, meta=told), images, units))
    hashes += [episode_hash(episode, images, units | {unit: "other"}) for unit in units]
    for key in images:
        changed = {name: [image.copy() for image in stream] for name, stream in images.items()}
        changed[key][-1].flat[-1] += 1
        hashes.append(episode_hash(episode, changed, units))
        hashes.append(episode_hash(episode, images | {key: images[key][:-1]}, units))
        hashes.append(episode_hash(episode, images | {key: images[key][::-1]}, units))
    assert len(set(hashes)) == len(hashes)
    assert combined_hash(hashes[:2]) != combined_hash(hashes[1::-1])

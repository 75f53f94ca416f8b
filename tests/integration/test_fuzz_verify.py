"""Whatever is done to the tables and descriptions of a dataset, `verify` has findings or none, and never dies."""

import json
import shutil
import tempfile
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lerobot_bimanual.dataset import schema
from lerobot_env_bimanual.verification.simulation import Player
from lerobot_env_bimanual.verification.verifier import Thoroughness, Verifier, verify_metadata

pytestmark = [pytest.mark.sim, pytest.mark.fuzz]

TABLES = (
    "data/chunk-000/file-000.parquet",
    "meta/episodes/chunk-000/file-000.parquet",
    "meta/tasks.parquet",
)
DESCRIPTIONS = ("meta/info.json", "meta/stats.json", "meta/bimanual.json")

scalars = st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=8)
values = st.recursive(
    scalars, lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(), inner, max_size=3)
)
arrays = st.sampled_from(
    [
        pa.int64(),
        pa.float32(),
        pa.string(),
        pa.bool_(),
        pa.binary(),
        pa.list_(pa.float32()),
        pa.list_(pa.string()),
        pa.null(),
        pa.struct([("bytes", pa.binary()), ("path", pa.string())]),
    ]
)


def change_table(path: Path, data: st.DataObject) -> None:
    """A cell, a column or the rows become something else."""
    table = pq.read_table(path)
    key = data.draw(st.sampled_from(table.column_names))
    place, kind = table.column_names.index(key), table.schema.field(key).type
    how = data.draw(st.sampled_from(["cell", "type", "drop", "rename", "rows", "cut"]))
    if how == "cell":
        cells = table[key].to_pylist()
        cells[data.draw(st.integers(0, len(cells) - 1))] = data.draw(values)
        try:
            table = table.set_column(place, key, pa.array(cells, kind))
        except (pa.ArrowException, TypeError, ValueError, OverflowError):
            table = table.set_column(place, key, pa.array([str(cell) for cell in cells]))
    elif how == "type":
        table = table.set_column(place, key, pa.nulls(len(table), data.draw(arrays)))
    elif how == "drop":
        table = table.drop_columns([key])
    elif how == "rename":
        table = table.rename_columns(
            [data.draw(st.text()) if name == key else name for name in table.column_names]
        )
    elif how == "rows":
        table = table.take(
            data.draw(st.lists(st.integers(0, len(table) - 1), max_size=30)) or pa.array([], pa.int64())
        )
    pq.write_table(table, path)
    if how == "cut":
        path.write_bytes(path.read_bytes()[: data.draw(st.integers(0, 2000))])


def change_json(path: Path, data: st.DataObject) -> None:
    """A value somewhere in it becomes something else, or disappears."""
    content = json.loads(path.read_text())
    parent, key = None, None
    inner = content
    while isinstance(inner, dict | list) and inner and data.draw(st.integers(0, 3)):
        parent = inner
        key = data.draw(st.sampled_from(sorted(inner) if isinstance(inner, dict) else range(len(inner))))
        inner = inner[key]
    if parent is None:
        content = data.draw(values)
    elif data.draw(st.booleans()):
        del parent[key]
    else:
        parent[key] = data.draw(values)
    path.write_text(json.dumps(content))


@given(view=st.sampled_from(schema.VIEWS), name=st.sampled_from(TABLES + DESCRIPTIONS), data=st.data())
def test_no_change_of_a_dataset_makes_verify_die(generated, view, name, data) -> None:
    with tempfile.TemporaryDirectory() as folder:
        root = Path(shutil.copytree(generated / view, Path(folder, view)))
        before = (root / name).read_bytes()
        (change_table if name in TABLES else change_json)(root / name, data)
        found = verify_metadata(root)
        assert bool(found["seal"]) == ((root / name).read_bytes() != before)
        report = Verifier(root, Thoroughness(simulate=False, rendered_rows=0), Player()).verify(1)
        assert all(isinstance(fault.text, str) for faults in report.faults.values() for fault in faults)
        assert (
            report.content_hash == ""
            or np.frombuffer(bytes.fromhex(report.content_hash), np.uint8).size == 32
        )

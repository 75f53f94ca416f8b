"""Commands and trainings check the given paths before they load anything."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

from lerobot_bimanual import cli
from lerobot_bimanual.checkpoint_folder import require_checkpoint_if_local
from lerobot_bimanual.dataset.schema import CALIBRATION_INFO, TASK_NAME, VERSION_INFO, WRIST_EXTRINSICS
from lerobot_bimanual.errors import BimanualError, DatasetError
from lerobot_policy_bimanual.training.dataset_folder import check_dataset
from lerobot_policy_bimanual.training.train import remove_older

WITHOUT_LEROBOT = """
import sys
from lerobot_bimanual import cli
codes = [cli.main(words.split()) for words in sys.argv[1:]]
print("codes", codes, "loaded", sorted({"torch", "lerobot", "PIL", "rich.console"} & set(sys.modules)))
"""
WRONG_PATHS = {
    "policy inspect --checkpoint=nowhere --root=none": "no checkpoint at nowhere",
    "policy accuracy --checkpoint=nowhere --root=none": "no checkpoint at nowhere",
    "policy inspect --checkpoint=there --root=none": "no dataset at none",
    "policy accuracy --checkpoint=there --root=none": "no dataset at none",
    "policy check --checkpoint=nowhere": "no checkpoint at nowhere",
}


def test_a_wrong_path_is_named_before_lerobot_and_torch_are_loaded(tmp_path):
    (tmp_path / "there").mkdir()
    (tmp_path / "there" / "config.json").write_text("{}")
    command = [sys.executable, "-c", WITHOUT_LEROBOT, *WRONG_PATHS]
    child = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert child.stdout == "codes [1, 1, 1, 1, 1] loaded []\n", child.stderr
    for told, message in zip(child.stderr.splitlines(), WRONG_PATHS.values(), strict=True):
        assert message in told


@pytest.mark.parametrize("below", ["", "last", "checkpoints/last"])
def test_a_folder_above_a_checkpoint_is_refused_with_the_path_of_the_checkpoint(tmp_path, capsys, below):
    folder = tmp_path / below / "pretrained_model"
    folder.mkdir(parents=True)
    (folder / "config.json").write_text("{}")
    assert cli.main(["policy", "check", f"--checkpoint={tmp_path}"]) == 1
    assert f"Do you mean {folder}?" in capsys.readouterr().err


def touch_dataset(folder, **info) -> None:
    (folder / "meta").mkdir(parents=True)
    (folder / "meta/info.json").write_text(json.dumps({"total_episodes": 4, "fps": 1, "features": {}} | info))


def test_a_folder_above_the_views_is_refused_with_the_paths_of_the_views(tmp_path):
    for view in ("frames", "keyframes"):
        touch_dataset(tmp_path / view)
    with pytest.raises(DatasetError, match=f"--dataset.root={tmp_path / 'keyframes'}"):
        check_dataset(tmp_path)
    check_dataset(tmp_path / "frames", (0, 3))
    with pytest.raises(DatasetError, match=r"has episodes 0 to 3, but --dataset\.episodes names 4"):
        check_dataset(tmp_path / "frames", (0, 4, 5))


@pytest.mark.parametrize(
    ("key", "info", "message"),
    [
        (TASK_NAME, {VERSION_INFO: 2}, "has schema version 2, .* `lerobot-bimanual dataset generate"),
        (WRIST_EXTRINSICS, {CALIBRATION_INFO: {}}, "the calibration in meta/info.json is damaged"),
        (TASK_NAME, "none", "features.task_name.info: .*Restore the file"),
    ],
)
def test_a_dataset_of_another_schema_is_refused_before_training(tmp_path, key, info, message):
    touch_dataset(tmp_path, features={key: {"dtype": "float32", "shape": [1], "info": info}})
    with pytest.raises(DatasetError, match=message):
        check_dataset(tmp_path)


def test_what_is_missing_here_is_not_looked_for_on_the_hub(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(DatasetError, match=r"no dataset at nowhere: .* does not exist"):
        check_dataset(Path("nowhere"))
    (tmp_path / "outputs").mkdir()
    for path in ("/nowhere/at/all", "outputs/nowhere", "./nowhere", "a/b/c"):
        with pytest.raises(BimanualError, match="no checkpoint at"):
            require_checkpoint_if_local(path)
    require_checkpoint_if_local("owner/name")


def test_old_checkpoints_go_but_not_those_beyond_the_last_one(tmp_path):
    for name in ("000500", "000750", "001000", "0001500", "0002000", "000500_kept"):
        (tmp_path / name).mkdir()
    (tmp_path / "last").symlink_to("0001500")
    remove_older(tmp_path, 2)
    kept = ["0001500", "0002000", "000500_kept", "001000", "last"]
    assert sorted(path.name for path in tmp_path.iterdir()) == kept
    (tmp_path / "last").unlink()
    remove_older(tmp_path, 1)  # the newest was being written when the training ended
    assert len([*tmp_path.iterdir()]) == 4

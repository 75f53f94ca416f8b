"""What may be asked of a dataset, by flags or by a file."""

import contextlib
import json

import pytest

from lerobot_bimanual.errors import BimanualError, DatasetError
from lerobot_env_bimanual.commands.dataset_generate import dataset_generate, settings_of
from lerobot_env_bimanual.generation.settings import GenerationSettings

pytestmark = pytest.mark.sim


@pytest.mark.parametrize(
    "change",
    [
        {"task": "wash_dishes"},
        {"task": "lift_ball,wash_dishes"},
        {"variation": "9"},
        {"cameras": ("rear",)},
        {"image_size": "0"},
        {"episodes": 0},
        {"episodes": 10**9},
        {"workers": -1},
        {"episodes_per_shard": 0},
        {"episodes_per_shard": 10**9},
        {"first_seed": -1},
        {"first_seed": 2**63},
        {"discretise": -1},
        {"discretise": 10**9},
        {"intermediate": ("1.5",)},
        {"intermediate": ("half",)},
        {"view": "all"},
        {"split": "exam"},
        {"repo_id": "../../elsewhere"},
    ],
)
def test_wrong_options_are_refused_before_anything_is_made(tmp_path, small_generation, change) -> None:
    with pytest.raises(BimanualError):
        dataset_generate(small_generation(tmp_path / "never", **change))
    assert not list(tmp_path.iterdir())


STRANGE = (None, True, -1, 0.5, "", "7", [], ["front"], [7], ["lift_ball", "lift_ball"], {}, {"any": 1}, [[]])


@pytest.mark.parametrize("option", GenerationSettings.__dataclass_fields__)
def test_settings_of_a_strange_file_are_read_or_refused_with_one_clear_error(
    generated, small_generation, option
) -> None:
    settings = settings_of(small_generation(generated))
    content = json.loads(json.dumps(settings.to_dict()))
    assert GenerationSettings.from_dict(content) == settings
    for value in STRANGE:
        with contextlib.suppress(BimanualError):
            read = GenerationSettings.from_dict(content | {option: value})
            assert json.loads(json.dumps(read.to_dict())) == content | {option: value}
    with pytest.raises(DatasetError, match=f"missing or unknown: {option}"):
        GenerationSettings.from_dict({name: content[name] for name in content if name != option})


@pytest.mark.parametrize("content", [None, [], "any", {"colour": "red"}])
def test_what_holds_no_settings_is_refused(content) -> None:
    with pytest.raises(DatasetError, match="settings of a dataset"):
        GenerationSettings.from_dict(content)

"""Recipes: found without importing what they belong to, and read as flags of LeRobot's training."""

import pytest

from lerobot_bimanual.benchmark.recipes import Recipe, option_text, option_value
from lerobot_bimanual.cameras import CAMERA_NAMES
from lerobot_bimanual.errors import BimanualError, InvalidChoice

INPUTS = """
dataset: {{repo_id: local/demonstrations, root: data/frames}}
steps: 4
batch_size: 2
save_freq: 2
policy:
  type: {policy}
  input_features:
    observation.images.left_wrist: {{type: VISUAL, shape: [3, 128, 128]}}
    observation.images.front_depth: {{type: VISUAL, shape: [1, 128, 128]}}
    observation.state: {{type: STATE, shape: [16]}}
"""


def test_any_distribution_adds_recipes_for_its_policy(install_recipe):
    install_recipe("mine")
    recipe = Recipe.find("mine", "small")
    assert (recipe.view, recipe.steps, recipe.batch_size, recipe.save_freq) == ("keyframes", 4, 2, 2)
    assert recipe.cameras == CAMERA_NAMES
    options = recipe.options(64)
    assert (options["dataset.root"], options["policy.shift"]) == ("data/keyframes", [0.5, 0])
    assert options["policy.head"] is None


def test_cameras_and_sizes_follow_from_the_inputs_that_are_named(install_recipe):
    install_recipe("mine", INPUTS)
    recipe = Recipe.find("mine", "small")
    assert recipe.cameras == ("front", "left_wrist")
    shapes = [feature["shape"] for feature in recipe.options(64)["policy.input_features"].values()]
    assert shapes == [[3, 64, 64], [1, 64, 64], [16]]


@pytest.mark.parametrize(
    ("text", "value"),
    [("2e-3", 0.002), ("[3, 9]", [3, 9]), ("null", None), ("true", True)]
    + [(text, text) for text in ("plain", '"1"', "{", "NaN", "[1", "9" * 5000, "[" * 100_000)],
)
def test_the_text_of_a_flag_is_read_as_data_or_kept(text, value):
    assert option_value(text) == value
    assert option_value(option_text(value)) == value


def test_an_unknown_policy_or_recipe_is_refused_with_those_that_are_installed(install_recipe):
    install_recipe("mine")
    with pytest.raises(InvalidChoice, match=r"policy is 'min', but must be one of: .*mine"):
        Recipe.find("min", "small")
    with pytest.raises(InvalidChoice, match="recipe for mine is 'large', but must be one of: small"):
        Recipe.find("mine", "large")


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("steps: 4", "steps: [4", "is not a recipe"),
        ("save_freq: 2", "", r"is not a recipe.*save_freq"),
        ("keyframes", "images", "is 'images', but must be one of: frames, keyframes"),
        ("{policy}", "theirs", "trains 'theirs', but is installed as a recipe for 'mine'"),
    ],
)
def test_a_file_that_says_too_little_is_refused_by_name(old, new, message, install_recipe):
    file = install_recipe("mine", INPUTS.replace("frames", "keyframes").replace(old, new))
    with pytest.raises(BimanualError, match=message) as caught:
        Recipe.find("mine", "small")
    assert str(file) in str(caught.value)

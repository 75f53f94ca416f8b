"""Recipes: which are found, what they say, and which are refused."""

import pytest

from lerobot_bimanual.benchmark.config import BenchmarkConfig
from lerobot_bimanual.benchmark.plan import Plan
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


def test_distributions_add_recipes_to_one_policy_and_none_hides_another(install_recipe, tmp_path):
    install_recipe("mine")
    file = install_recipe("theirs")
    metadata = tmp_path / "site_theirs" / "theirs-1.0.dist-info"
    (metadata / "entry_points.txt").write_text("[lerobot_bimanual.recipes]\nmine = package_of_theirs\n")
    with pytest.raises(
        BimanualError, match=r"two distributions have a recipe 'small' for mine: .*rename one"
    ):
        Recipe.files("mine")
    file.rename(file.with_name("large.yaml"))
    assert Recipe.files("mine").keys() == {"small", "large"}


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


def test_an_unknown_policy_or_recipe_is_refused_with_those_that_are_installed(install_recipe, tmp_path):
    install_recipe("mine")
    with pytest.raises(InvalidChoice, match=r"policy is 'min', but must be .*mine.*=FILE.yaml"):
        Recipe.find("min", "small")
    with pytest.raises(InvalidChoice, match="recipe for mine is 'large', but must be one of: small"):
        Recipe.find("mine", "large")
    file = tmp_path / "large.yaml"
    file.write_text(install_recipe("theirs").read_text().replace("theirs", "smolvla"))
    plan = Plan.of(BenchmarkConfig(policy="smolvla", recipe=str(file)))
    assert (plan.settings.recipe, plan.settings.demos) == ("large", 100)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("steps: 4", "steps: [4", "parsing a flow sequence"),
        ("save_freq: 2", "", r"is not a recipe.*save_freq"),
        ("keyframes", "images", "is 'images', but must be one of: frames, keyframes"),
        ("{policy}", "theirs", "trains 'theirs', but must train 'mine'"),
        ("type: STATE, ", "", r"is not a recipe.*type"),
        (
            "left_wrist",
            "overhead",
            r"is 'observation\.images\.overhead', but must be one of: .*images\.front_depth",
        ),
    ],
)
def test_a_file_that_says_too_little_is_refused_by_name(old, new, message, install_recipe):
    file = install_recipe("mine", INPUTS.replace("frames", "keyframes").replace(old, new))
    with pytest.raises(BimanualError, match=message) as caught:
        Recipe.find("mine", "small")
    assert str(file) in str(caught.value)

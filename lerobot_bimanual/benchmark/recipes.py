"""Recipes: how policies are trained, as config files of `lerobot-train` beside the policies, and the sizes of their benchmarks.

A distribution adds recipes for a policy by an entry point `policy = "package"` in the group
`lerobot_bimanual.recipes`; the files are `recipes/<name>.yaml` in that package. A recipe holds whatever
`lerobot-train` can be told; a benchmark needs `policy.type`, `steps`, `batch_size`, `save_freq`, and `dataset.root`,
whose last folder names the view that the policy learns from.
"""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.metadata import entry_points
from pathlib import Path
from typing import Any, Self, cast, get_args

from lerobot_bimanual.cameras import CAMERA_NAMES
from lerobot_bimanual.dataset import schema
from lerobot_bimanual.distributions import entries, module_path
from lerobot_bimanual.errors import BimanualError, InvalidChoice, did_you_mean
from lerobot_bimanual.files import read_yaml

GROUP = "lerobot_bimanual.recipes"


@dataclass(frozen=True)
class Sizes:
    """Numbers of a benchmark that concern neither training nor protocol, the same for every policy.

    Attributes:
        image_size: side of the images in pixels, in the demonstrations and in the evaluations.
        val_episodes: episodes of the split `val` on which every checkpoint is scored to choose the best; with 0 the last
            one is tested. In `small`, the learning rate is almost 0 at the last step: twenty episodes would choose by chance.
        test_episodes: episodes of the split `test` on which the chosen checkpoint is scored.
        intermediate: fractions of the motion to a keypose at which the view `keyframes` keeps further observations. The
            paper keeps every tenth frame. Their label is the keypose that the hand has nearly reached, which teaches a
            small network to stay where it is (docs/learning.md).
    """

    image_size: int
    val_episodes: int
    test_episodes: int
    intermediate: tuple[float, ...]


SIZES = {
    "small": Sizes(image_size=128, val_episodes=0, test_episodes=50, intermediate=()),
    "paper": Sizes(image_size=256, val_episodes=100, test_episodes=100, intermediate=(0.35, 0.7)),
}
"""By the name of the recipe; the second is that of the PerAct2 paper."""
SUFFIX = ".yaml"


def sizes(recipe: str) -> Sizes:
    """The sizes of a recipe's benchmarks, by its name; of a user's own file those of `small`."""
    return SIZES.get(recipe, SIZES["small"])


@dataclass(frozen=True)
class Recipe:
    """How a policy is trained: all sections of a recipe file, and the values that a benchmark reads from them."""

    file: Path
    sections: Mapping[str, Any]
    view: schema.View
    steps: int
    batch_size: int
    save_freq: int

    @classmethod
    def find(cls, policy: str, name: str) -> Self:
        """The recipe of that name for a policy, or the one in a file.

        Raises:
            InvalidChoice: no installed distribution has recipes for the policy, or it has none of that name.
            BimanualError: the file is not YAML, lacks what a benchmark needs, or is of another policy.
        """
        files = {name: Path(name)} if name.endswith(SUFFIX) else cls.files(policy)
        if name not in files:
            raise InvalidChoice(f"recipe for {policy}", name, files)
        sections = read_yaml(files[name])
        try:
            view, type_ = Path(sections["dataset"]["root"]).name, sections["policy"]["type"]
            numbers = [int(sections[each]) for each in ("steps", "batch_size", "save_freq")]
            recipe = cls(files[name], sections, cast("schema.View", view), *numbers)
            recipe.options(image_size=1)  # fails on inputs that LeRobot could not read
        except (ValueError, TypeError, KeyError, AttributeError, IndexError) as error:
            raise BimanualError(f"{files[name]} is not a recipe of a benchmark: {error!r}") from error
        if view not in schema.VIEWS:
            raise InvalidChoice(f"last folder of dataset.root in {files[name]}", view, get_args(schema.View))
        known = [key(camera) for camera in CAMERA_NAMES for key in (schema.image_key, schema.depth_key)]
        for key, feature in recipe._features.items():
            if feature["type"] == "VISUAL" and key not in known:
                raise InvalidChoice(f"image among the input_features in {files[name]}", key, known)
        if type_ != policy:
            raise BimanualError(f"{files[name]} trains {type_!r}, but must train {policy!r}")
        return recipe

    @staticmethod
    def files(policy: str) -> dict[str, Path]:
        """Files of the installed recipes for a policy, by name; a policy without any is an InvalidChoice."""
        packages = entries(GROUP)
        if policy not in packages:
            valid = f"{', '.join(packages)}, or another that LeRobot knows, with --recipe=FILE.yaml"
            raise InvalidChoice("policy", policy, f"{valid}.{did_you_mean(policy, packages)}")
        files: dict[str, Path] = {}
        for entry in entry_points(group=GROUP, name=policy):
            folder = module_path(entry.value) if entry.pattern.match(entry.value) else None
            for path in sorted(folder.glob(f"recipes/*{SUFFIX}")) if folder else ():
                if files.setdefault(path.stem, path) != path:
                    raise BimanualError(
                        f"two distributions have a recipe {path.stem!r} for {policy}: {files[path.stem]} and {path}; rename one"
                    )
        return files

    @property
    def cameras(self) -> tuple[str, ...]:
        """Cameras among the inputs that the recipe names; all five if it names none."""
        inputs = self._features.keys()
        named = [name for name in CAMERA_NAMES if inputs & {schema.image_key(name), schema.depth_key(name)}]
        return tuple(named) or CAMERA_NAMES

    @property
    def depth(self) -> bool:
        """Whether depth is among the inputs that the recipe names; if it names none, whether its view has it by default."""
        inputs = self._features.keys()
        named = bool(inputs & {schema.depth_key(name) for name in CAMERA_NAMES})
        return named if inputs else self.view == "keyframes"

    @property
    def control_mode(self) -> str:
        """`keypose` for LeRobot's own policies on keyposes, whose action LeRobot sets to the environment's; else empty."""
        return "keypose" if self.view == "keyframes" and not self.depth else ""

    def options(self, image_size: int) -> dict[str, Any]:
        """The recipe as options of `lerobot-train` by name, for images of that many pixels a side."""
        options: dict[str, Any] = {}
        for name, value in self.sections.items():
            if isinstance(value, dict):
                options |= {f"{name}.{key}": option_value(inner) for key, inner in value.items()}
            else:
                options[name] = option_value(value)
        if self._features:
            options["policy.input_features"] = {
                key: {**feature, "shape": [feature["shape"][0], image_size, image_size]}
                if feature["type"] == "VISUAL"
                else feature
                for key, feature in self._features.items()
            }
        return options

    @property
    def _features(self) -> Mapping[str, dict[str, Any]]:
        return self.sections["policy"].get("input_features") or {}


def option_text(value: Any) -> str:
    """The value of an option as the text of a flag."""
    return value if isinstance(value, str) else json.dumps(value)


def option_value(text: Any) -> Any:
    """The value of a text of a flag or of YAML: numbers and lists as data, so that 2e-3 and 0.002 are equal; else as it is."""
    if not isinstance(text, str):
        return text
    try:
        value = json.loads(text)
        json.dumps(value, allow_nan=False)
    except (ValueError, RecursionError):
        return text
    return text if isinstance(value, str) else value

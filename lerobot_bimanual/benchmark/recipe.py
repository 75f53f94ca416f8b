"""Recipes: how policies are trained, as config files of `lerobot-train` that lie beside them.

A distribution adds recipes for a policy by an entry point `policy = "package"` in the group
`lerobot_bimanual.recipes`; the files are `recipes/<name>.yaml` in that package. Whatever `lerobot-train` can be told
may stand there; a benchmark needs `policy.type`, `steps`, `batch_size`, `save_freq`, and `dataset.root`, whose last
folder names the view that the policy learns from.
"""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self, get_args

import yaml

from lerobot_bimanual.cameras import CAMERA_NAMES
from lerobot_bimanual.dataset import schema
from lerobot_bimanual.distributions import entries, location
from lerobot_bimanual.errors import BimanualError, InvalidChoice

GROUP = "lerobot_bimanual.recipes"


@dataclass(frozen=True)
class Recipe:
    """How a policy is trained.

    Attributes:
        sections: content of the file.
        view: dataset view that the policy learns from.
        steps: optimiser steps.
        batch_size: rows of the dataset per step.
        save_freq: steps from one checkpoint to the next.
    """

    sections: Mapping[str, Any]
    view: schema.View
    steps: int
    batch_size: int
    save_freq: int

    @classmethod
    def find(cls, policy: str, name: str) -> Self:
        """The recipe of that name for a policy.

        Raises:
            InvalidChoice: no installed distribution has recipes for the policy, or it has none of that name.
            BimanualError: the file is no recipe.
        """
        packages = entries(GROUP)
        if policy not in packages:
            raise InvalidChoice("policy", policy, packages)
        folder = location(packages[policy].value)
        files = {path.stem: path for path in sorted(folder.glob("recipes/*.yaml"))} if folder else {}
        if name not in files:
            raise InvalidChoice(f"recipe for {policy}", name, files)
        recipe = cls.read(files[name])
        if (type_ := recipe.sections["policy"]["type"]) != policy:
            raise BimanualError(
                f"{files[name]} trains {type_!r}, but is installed as a recipe for {policy!r}"
            )
        return recipe

    @classmethod
    def read(cls, path: Path) -> Self:
        """The recipe in a file.

        Raises:
            BimanualError: it is not YAML, or lacks what a benchmark needs.
        """
        try:
            sections = yaml.safe_load(path.read_text(encoding="utf-8"))
            view = Path(sections["dataset"]["root"]).name
            numbers = [int(sections[name]) for name in ("steps", "batch_size", "save_freq")]
            sections["policy"]["type"]
        except (OSError, ValueError, TypeError, KeyError, yaml.YAMLError) as error:
            raise BimanualError(f"{path} is no recipe of a benchmark: {error!r}") from error
        if view not in schema.VIEWS:
            raise InvalidChoice(f"last folder of dataset.root in {path}", view, get_args(schema.View))
        return cls(sections, view, *numbers)

    @property
    def cameras(self) -> tuple[str, ...]:
        """Cameras among the inputs that the recipe names; all five if it names none."""
        inputs = self.sections["policy"].get("input_features", {}).keys()
        named = [name for name in CAMERA_NAMES if inputs & {schema.image_key(name), schema.depth_key(name)}]
        return tuple(named) or CAMERA_NAMES

    @property
    def depth(self) -> bool:
        """Whether depth is among the inputs that the recipe names; true if it names none."""
        inputs = self.sections["policy"].get("input_features", {}).keys()
        return not inputs or bool(inputs & {schema.depth_key(name) for name in CAMERA_NAMES})

    def flags(self, image_size: int) -> dict[str, str]:
        """The recipe as flags of `lerobot-train` by name, for images of that many pixels a side."""
        flags: dict[str, str] = {}
        for name, value in self.sections.items():
            if isinstance(value, dict):
                flags |= {f"{name}.{key}": flag_text(inner) for key, inner in value.items()}
            else:
                flags[name] = flag_text(value)
        if features := self.sections["policy"].get("input_features"):
            flags["policy.input_features"] = flag_text(_resized(features, image_size))
        return flags


def _resized(features: Mapping[str, Mapping[str, Any]], image_size: int) -> dict[str, Mapping[str, Any]]:
    return {
        key: {**feature, "shape": [feature["shape"][0], image_size, image_size]}
        if feature["type"] == "VISUAL"
        else feature
        for key, feature in features.items()
    }


def flag_text(value: Any) -> str:
    """A value as the text of a flag."""
    return value if isinstance(value, str) else json.dumps(value)

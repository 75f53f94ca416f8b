"""Every `BimanualError` can be pickled; texts of levels, such as `mass:2`, are parsed or refused."""

import importlib
import inspect
import pickle
import pkgutil
from collections.abc import Iterator
from pathlib import Path

import pytest

from lerobot_bimanual.errors import BimanualError, InvalidChoice
from lerobot_bimanual.perturbation_levels import levels_text, parse_levels

PACKAGES = ("lerobot_bimanual", "lerobot_env_bimanual", "lerobot_policy_bimanual")
"""Those with errors of their own."""
SAMPLES = {"valid": ["this", "that"], "count": 3, "folder": Path("shards/000001")}
"""Arguments of constructors that are not texts."""


def error_classes(base: type[BimanualError] = BimanualError) -> Iterator[type[BimanualError]]:
    yield base
    for kind in base.__subclasses__():
        yield from error_classes(kind)


def test_every_error_survives_the_way_between_processes() -> None:
    for package in map(importlib.import_module, PACKAGES):
        for module in pkgutil.walk_packages(package.__path__, f"{package.__name__}."):
            if not module.name.endswith("__main__"):
                importlib.import_module(module.name)
    kinds = set(error_classes())
    assert {kind.__module__.partition(".")[0] for kind in kinds} == set(PACKAGES)
    for kind in kinds:
        names = [*inspect.signature(kind).parameters] if kind.__init__ is not Exception.__init__ else ["text"]
        error = kind(*(SAMPLES.get(name, f"some {name}") for name in names))
        again = pickle.loads(pickle.dumps(error))
        assert (type(again), str(again), vars(again)) == (kind, str(error), vars(error))


@pytest.mark.parametrize(
    ("text", "levels"),
    [
        ("", {}),
        ("mass:2", {"mass": 2}),
        (" mass:2 , camera_moved:1,", {"camera_moved": 1, "mass": 2}),
        ("mass:0", {}),
        ("mass:0,light:3", {"light": 3}),
    ],
)
def test_a_text_says_the_level_of_each_axis_and_leaves_out_level_0(text, levels):
    assert parse_levels(text) == levels
    assert list(parse_levels(text)) == sorted(levels)
    assert parse_levels(levels_text(levels)) == levels


@pytest.mark.parametrize("text", ["mass", "mass:4", "mass:-1", "mass:two", ":1", "mass:1,mass:2", "a b:1", 3])
def test_a_text_that_is_not_a_list_of_levels_is_refused_with_the_right_form(text):
    with pytest.raises(InvalidChoice, match="AXIS:LEVEL with levels 0 to 3"):
        parse_levels(text)

"""Our code depends on no private name of LeRobot, which any version may remove."""

import ast
import importlib
import inspect
import pkgutil
from collections.abc import Iterator
from pathlib import Path
from types import FunctionType

import pytest

PACKAGES = ("lerobot_bimanual", "lerobot_env_bimanual", "lerobot_policy_bimanual", "lerobot_robot_bimanual")
REPOSITORY = Path(__file__).parents[2]
SOURCES = [
    path
    for folder in ("lerobot_bimanual", "envs", "policies", "robots", "benchmarks", "examples", "tests")
    for path in sorted((REPOSITORY / folder).rglob("*.py"))
]
METHODS = (FunctionType, classmethod, staticmethod, property)


def private(name: str) -> bool:
    return name.startswith("_") and not name.startswith("__")


def classes() -> Iterator[type]:
    for package in PACKAGES:
        for module in pkgutil.walk_packages(importlib.import_module(package).__path__, f"{package}."):
            if "vla_eval" not in module.name and not module.name.endswith("__main__"):
                members = filter(inspect.isclass, vars(importlib.import_module(module.name)).values())
                yield from (kind for kind in members if kind.__module__ == module.name)


@pytest.mark.slow
def test_no_class_overrides_a_private_method_of_lerobot():
    found = {
        f"{kind.__module__}.{kind.__name__}.{name} of {base.__module__}"
        for kind in classes()
        for base in kind.__mro__
        if base.__module__.startswith("lerobot.")
        for name in vars(kind).keys() & vars(base).keys()
        if private(name) and isinstance(vars(base)[name], METHODS)
    }
    assert not found


def test_no_private_name_is_imported_and_no_name_in_a_module_of_lerobot_is_replaced():
    found = []
    for path in SOURCES:
        modules = set()
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.ImportFrom) and (node.module or "").partition(".")[0] == "lerobot":
                names = [*str(node.module).split("."), *(alias.name for alias in node.names)]
                found += [(path.name, node.lineno, name) for name in names if private(name)]
                modules |= {alias.asname or alias.name for alias in node.names if alias.name.islower()}
            if isinstance(node, ast.Assign):
                targets = [target for target in node.targets if isinstance(target, ast.Attribute)]
                owners = {target.value.id for target in targets if isinstance(target.value, ast.Name)}
                found += [(path.name, node.lineno, owner) for owner in owners & modules]
    assert not found

"""Inside each distribution imports only go down, also where only a type checker looks."""

import ast
import tomllib
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
FLOORS = tomllib.loads((ROOT / "docs/floors.toml").read_text(encoding="utf-8"))
FOLDERS = {
    "lerobot_bimanual": ROOT / "lerobot_bimanual",
    "lerobot_env_bimanual": ROOT / "envs/lerobot_env_bimanual",
    "lerobot_policy_bimanual": ROOT / "policies/lerobot_policy_bimanual",
    "lerobot_robot_bimanual": ROOT / "robots/lerobot_robot_bimanual",
}
DISTRIBUTIONS = pytest.mark.parametrize("distribution", FOLDERS)


def modules(distribution: str) -> dict[str, Path]:
    """Dotted name below the distribution -> file; the front door, its `__init__`, is no room."""
    folder = FOLDERS[distribution]
    found = {}
    for path in sorted(folder.rglob("*.py")):
        parts = path.relative_to(folder).with_suffix("").parts
        if name := ".".join(parts[:-1] if parts[-1] == "__init__" else parts):
            found[name] = path
    return found


def imports(distribution: str, path: Path, known: dict[str, Path]) -> set[str]:
    """Modules of the same distribution that a file imports, anywhere in it."""
    names: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names.update(alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            names.add(node.module)
            names.update(f"{node.module}.{alias.name}" for alias in node.names)
    prefix = distribution + "."
    return {name.removeprefix(prefix) for name in names if name.removeprefix(prefix) in known} & known.keys()


def graph(distribution: str) -> dict[str, set[str]]:
    known = modules(distribution)
    return {name: imports(distribution, path, known) - {name} for name, path in known.items()}


def room(module: str) -> str:
    return module.partition(".")[0]


def circles(edges: dict[str, set[str]]) -> Iterator[list[str]]:
    """Every import that leads back to where one came from, as the way there."""
    done: set[str] = set()

    def walk(module: str, way: list[str]) -> Iterator[list[str]]:
        if module in way:
            yield [*way[way.index(module) :], module]
            return
        if module in done:
            return
        for other in sorted(edges[module]):
            yield from walk(other, [*way, module])
        done.add(module)

    for module in sorted(edges):
        yield from walk(module, [])


@DISTRIBUTIONS
def test_every_module_stands_on_a_declared_floor_and_every_floor_has_one(distribution):
    assert {room(module) for module in modules(distribution)} == set(FLOORS[distribution])


@DISTRIBUTIONS
def test_imports_only_go_down(distribution):
    height = {name: index for index, name in enumerate(FLOORS[distribution])}
    upward = {
        f"{module} imports {other}"
        for module, others in graph(distribution).items()
        for other in others
        if height[room(other)] > height[room(module)]
    }
    assert not upward


@DISTRIBUTIONS
def test_no_imports_go_in_circles(distribution):
    assert not list(circles(graph(distribution)))


def test_a_circle_is_found():
    assert list(circles({"a": {"b"}, "b": {"c"}, "c": {"b"}})) == [["b", "c", "b"]]
    assert not list(circles({"a": {"b", "c"}, "b": {"c"}, "c": set()}))

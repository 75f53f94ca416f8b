"""The rooms and their arrows: robots -> envs -> core <- policies, and what may be imported only lazily."""

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
CORE = ROOT / "lerobot_bimanual"
ENVS = ROOT / "envs/lerobot_env_bimanual"
POLICIES = ROOT / "policies/lerobot_policy_bimanual"
ROBOTS = ROOT / "robots/lerobot_robot_bimanual"

FORBIDDEN = [
    (CORE, {"lerobot_env_bimanual", "lerobot_policy_bimanual", "lerobot_robot_bimanual", "mujoco"}),
    (ENVS, {"lerobot_policy_bimanual", "lerobot_robot_bimanual"}),
    (POLICIES, {"lerobot_env_bimanual", "lerobot_robot_bimanual", "mujoco"}),
    (ROBOTS, {"lerobot_policy_bimanual"}),
]
# What worker processes of vector environments import; LeRobot or torch would cost each of them seconds.
WORKER_MODULES = (
    "lerobot_env_bimanual.env",
    "lerobot_env_bimanual.vector",
    "lerobot_env_bimanual.expert.runner",
)
HEAVY = {"lerobot", "torch", "draccus", "datasets"}


def imports(tree: ast.AST) -> Iterator[str]:
    """Dotted names of all modules imported anywhere below a node."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            yield node.module
            yield from (f"{node.module}.{alias.name}" for alias in node.names)  # perhaps modules themselves


def imports_at_load(tree: ast.Module) -> Iterator[str]:
    """As `imports`, but only what runs when the module is imported unconditionally."""
    for node in tree.body:
        if not isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.If):
            yield from imports(node)


def tops(names: Iterator[str]) -> set[str]:
    return {name.partition(".")[0] for name in names}


def source_of(module: str) -> Path | None:
    """File of one of our modules; None for any other name."""
    for package in (CORE, ENVS, POLICIES):
        path = package.parent / Path(*module.split("."))
        if module.partition(".")[0] == package.name:
            candidates = (path.with_suffix(".py"), path / "__init__.py")
            return next((candidate for candidate in candidates if candidate.is_file()), None)
    return None


def parse(source: Path) -> ast.Module:
    return ast.parse(source.read_text(encoding="utf-8"), source)


@pytest.mark.parametrize(("room", "forbidden"), FORBIDDEN, ids=lambda value: getattr(value, "name", ""))
def test_no_room_imports_what_it_must_not_know(room: Path, forbidden: set[str]) -> None:
    sources = sorted(room.rglob("*.py"))
    assert sources
    offenders = {
        source.name: found for source in sources if (found := tops(imports(parse(source))) & forbidden)
    }
    assert not offenders


def test_core_holds_no_networks() -> None:
    assert not [source.name for source in CORE.rglob("*.py") if "torch.nn" in set(imports(parse(source)))]


def test_what_a_worker_loads_imports_neither_lerobot_nor_torch() -> None:
    waiting, seen, offenders = [*WORKER_MODULES], set(), {}
    while waiting:
        name = waiting.pop()
        source = source_of(name)
        if source is None or source in seen:
            continue
        seen.add(source)
        imported = set(imports_at_load(parse(source)))
        if heavy := tops(iter(imported)) & HEAVY:
            offenders[name] = heavy
        waiting += [*imported, name.rpartition(".")[0]]
    assert len(seen) > len(WORKER_MODULES)
    assert not offenders


def test_the_import_check_sees_every_form_of_import() -> None:
    tree = ast.parse("import torch.nn\nfrom mujoco import mjx\ndef f():\n    import lerobot.envs as envs\n")
    assert tops(imports(tree)) == {"torch", "mujoco", "lerobot"}
    assert tops(imports_at_load(tree)) == {"torch", "mujoco"}

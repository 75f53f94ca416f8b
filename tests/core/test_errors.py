"""Every error that is raised on purpose comes home from a worker process as it was raised."""

import ast
import importlib
import inspect
import pickle
from collections.abc import Iterator
from pathlib import Path

import pytest

from lerobot_bimanual.errors import BimanualError, KeyposeFailure

ROOT = Path(__file__).parents[2]
DISTRIBUTIONS = {"lerobot_bimanual": ROOT, "lerobot_env_bimanual": ROOT / "envs"} | {
    "lerobot_policy_bimanual": ROOT / "policies",
    "lerobot_robot_bimanual": ROOT / "robots",
}


def written_errors() -> set[str]:
    """`module:name` of every class in the sources that descends from `BimanualError`."""
    classes: dict[str, tuple[str, set[str]]] = {}
    for package, folder in DISTRIBUTIONS.items():
        for path in sorted((folder / package).rglob("*.py")):
            text = path.read_text(encoding="utf-8")
            if "class " in text:
                module = ".".join(path.relative_to(folder).with_suffix("").parts)
                for node in ast.parse(text).body:
                    if isinstance(node, ast.ClassDef):
                        bases = {ast.unparse(base).rpartition(".")[2] for base in node.bases}
                        classes[node.name] = (module, bases)
    found = {"BimanualError"}
    while more := {name for name, (_, bases) in classes.items() if bases & found} - found:
        found |= more
    return {f"{classes[name][0]}:{name}" for name in found}


WRITTEN = written_errors()
for _entry in sorted(WRITTEN):
    importlib.import_module(_entry.partition(":")[0])

SAMPLES = {"valid": ["this", "that"], "count": 3, "folder": Path("shards/000001")}
"""Arguments that are no text."""


def error_classes(base: type[BimanualError] = BimanualError) -> Iterator[type[BimanualError]]:
    yield base
    for kind in base.__subclasses__():
        yield from error_classes(kind)


def test_every_error_in_the_sources_is_tried():
    assert {f"{kind.__module__}:{kind.__name__}" for kind in error_classes()} >= WRITTEN
    assert {entry.partition(".")[0].partition(":")[0] for entry in WRITTEN} == set(DISTRIBUTIONS)


def made(kind: type[BimanualError]) -> BimanualError:
    if kind.__init__ is Exception.__init__:
        return kind("some message")
    names = [*inspect.signature(kind.__init__).parameters][1:]
    return kind(*(SAMPLES.get(name, f"some {name}") for name in names))


@pytest.mark.parametrize("kind", sorted(error_classes(), key=str), ids=lambda kind: kind.__name__)
def test_every_error_survives_the_way_between_processes(kind: type[BimanualError]) -> None:
    error = made(kind)
    again = pickle.loads(pickle.dumps(error))
    assert type(again) is kind
    assert str(again) == str(error)
    assert vars(again) == vars(error)


def test_a_keypose_failure_still_says_which_arm_it_was() -> None:
    failure = pickle.loads(pickle.dumps(KeyposeFailure("left", "out of reach")))
    assert (failure.arm, failure.reason) == ("left", "out of reach")

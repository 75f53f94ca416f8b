"""Every error that is raised on purpose comes home from a worker process as it was raised."""

import inspect
import pickle
from collections.abc import Iterator
from pathlib import Path

import pytest

import lerobot_policy_bimanual.configurations  # noqa: F401  both define errors of their own
from lerobot_bimanual.errors import BimanualError, KeyposeFailure

SAMPLES = {"valid": ["this", "that"], "count": 3, "folder": Path("shards/000001")}
"""Arguments that are no text."""


def error_classes(base: type[BimanualError] = BimanualError) -> Iterator[type[BimanualError]]:
    yield base
    for kind in base.__subclasses__():
        yield from error_classes(kind)


def made(kind: type[BimanualError]) -> BimanualError:
    if kind.__init__ is Exception.__init__:
        return kind("some message")
    names = [*inspect.signature(kind.__init__).parameters][1:]
    return kind(*(SAMPLES.get(name, f"some {name}") for name in names))


@pytest.mark.parametrize("kind", list(error_classes()), ids=lambda kind: kind.__name__)
def test_every_error_survives_the_way_between_processes(kind: type[BimanualError]) -> None:
    error = made(kind)
    again = pickle.loads(pickle.dumps(error))
    assert type(again) is kind
    assert str(again) == str(error)
    assert vars(again) == vars(error)


def test_a_keypose_failure_still_says_which_arm_it_was() -> None:
    failure = pickle.loads(pickle.dumps(KeyposeFailure("left", "out of reach")))
    assert (failure.arm, failure.reason) == ("left", "out of reach")

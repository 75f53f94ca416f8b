"""What the programs of a benchmark write is read only if it is what was asked of them."""

import json

import pytest
from made_up_rows import episodes

from lerobot_bimanual.benchmark.episode_result import EpisodeResult
from lerobot_bimanual.benchmark.measurements import Certified, read_certificate, read_evaluation
from lerobot_bimanual.benchmark.results import BadResult
from lerobot_bimanual.errors import BimanualError


def evaluation(*successes: list[bool]) -> str:
    return json.dumps({"per_task": [{"metrics": {"successes": task}} for task in successes]})


def test_an_evaluation_gives_an_episode_per_seed(tmp_path):
    path = tmp_path / "eval_info.json"
    path.write_text(evaluation([True, False]))
    assert read_evaluation(path, range(7, 9)) == episodes("x.", first_seed=7)
    with pytest.raises(BadResult, match="holds 2 episodes, but 3 were asked for"):
        read_evaluation(path, range(7, 10))


def test_an_evaluation_of_several_tasks_is_refused(tmp_path):
    path = tmp_path / "eval_info.json"
    path.write_text(evaluation([True], [True]))
    with pytest.raises(BadResult, match="holds 2 tasks"):
        read_evaluation(path, range(1))


def certificate(*tasks: str, **changes) -> str:
    played = [
        {
            "task": task,
            "variation": 1,
            "seed": seed,
            "success": bool(seed),
            "failure": "" if seed else "fell",
            "state_hash": f"{seed:02x}",
            "ticks": 7,
        }
        for seed, task in enumerate(tasks)
    ]
    head = {"control": "expert", "discretise": 0, "split": "test", "worlds": dict.fromkeys(tasks, "00")}
    return json.dumps(head | {"episodes": played} | changes)


def test_a_certificate_gives_variation_failure_and_final_state(tmp_path):
    path = tmp_path / "expert.json"
    path.write_text(certificate("lift_ball", "lift_ball"))
    assert read_certificate(path, "expert", "lift_ball", range(2)) == Certified(
        "00", (EpisodeResult(0, False, 1, "fell", "00"), EpisodeResult(1, True, 1, None, "01"))
    )


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (certificate("lift_ball", "push_box"), r"tasks is \['lift_ball', 'push_box'\], but \['lift_ball'\]"),
        (certificate("lift_ball"), r"seeds is \[0\], but \[0, 1\] was asked for"),
        (certificate("lift_ball", "lift_ball", control="blind"), "control is 'blind', but 'expert'"),
        (certificate("lift_ball", "lift_ball", discretise=100), "discretise is 100, but 0"),
        (certificate("lift_ball", "lift_ball", split="train"), "split is 'train', but 'test'"),
        (certificate("lift_ball", "lift_ball", worlds={}), r"tasks of worlds is \[\]"),
    ],
)
def test_a_certificate_of_anything_else_than_was_asked_for_is_refused(content, message, tmp_path):
    path = tmp_path / "expert.json"
    path.write_text(content)
    with pytest.raises(BadResult, match=rf"expert\.json: {message}"):
        read_certificate(path, "expert", "lift_ball", range(2))


@pytest.mark.parametrize(
    "content", [b"", b"[]", b"{}", b"\xff", b"[" * 100_000, b'{"per_task": [1], "episodes": [1]}']
)
@pytest.mark.parametrize(
    "read",
    [
        lambda path: read_certificate(path, "expert", "lift_ball", [0]),
        lambda path: read_evaluation(path, [0]),
    ],
    ids=["certificate", "evaluation"],
)
def test_measurements_of_another_form_are_refused_by_name(read, content, tmp_path):
    path = tmp_path / "measured.json"
    path.write_bytes(content)
    with pytest.raises(BimanualError, match=r"measured\.json"):
        read(path)

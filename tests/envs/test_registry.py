import json
import os
import subprocess
import sys
from dataclasses import replace

import pytest

from lerobot_bimanual.errors import BimanualError, InvalidChoice
from lerobot_env_bimanual.commands.task_list import TaskListConfig, task_list
from lerobot_env_bimanual.task import Prehension
from lerobot_env_bimanual.tasks.registry import (
    TASKS,
    get_task,
    list_suites,
    list_tasks,
    register,
    resolve_tasks,
)


@pytest.mark.parametrize("changes", [{"name": "new_name"}, {"id": 99}])
def test_a_second_task_with_the_same_name_or_id_is_refused(changes):
    original = type(get_task("push_box"))
    twin = type("Twin", (original,), {"spec": replace(original.spec, **changes)})
    with pytest.raises(ValueError, match="clashes with 'push_box'"):
        register(twin)
    assert get_task("push_box").__class__ is original


def test_unknown_names_are_answered_with_the_valid_ones():
    for ask in (get_task, resolve_tasks):
        message = r"'push_boxes', .*handover_item_easy, lift_ball.*push_box.* Did you mean 'push_box'\?"
        with pytest.raises(InvalidChoice, match=message):
            ask("push_boxes")


def test_a_selection_keeps_its_order_and_loses_repetitions():
    assert resolve_tasks("push_box, lift_ball,push_box") == ("push_box", "lift_ball")
    assert resolve_tasks(["lift_ball", "all"])[0] == "lift_ball"
    assert sorted(resolve_tasks("all")) == list(list_tasks())


def test_suites_follow_from_the_taxonomy():
    suites = list_suites()
    for name in list_tasks():
        taxonomy = get_task(name).spec.taxonomy
        assert name in suites["all"]
        for suite in ("symmetric", "synchronous"):
            assert (name in suites[suite]) == (name not in suites[f"a{suite}"]) == getattr(taxonomy, suite)
        for coupling in ("temporal", "spatial", "physical"):
            assert (name in suites.get(coupling, ())) == getattr(taxonomy, coupling)
        assert [kind for kind in Prehension if name in suites.get(kind, ())] == [taxonomy.prehension]


def test_the_verb_lists_every_task_for_programs(capsys):
    task_list(TaskListConfig(format="json"))
    rows = {row["name"]: row for row in json.loads(capsys.readouterr().out)}
    assert sorted(rows) == list(list_tasks())
    assert rows["lift_ball"]["instructions"] == [["lift the ball"]]
    assert rows["lift_ball"]["success"][0] == "above(ball, 0.95)"
    assert rows["push_box"]["taxonomy"]["prehension"] == "non_prehensile"


@pytest.mark.parametrize("group", ["tasks", "perturbations"])
def test_what_is_broken_in_another_distribution_is_a_warning_and_nothing_more(group, tmp_path):
    metadata = tmp_path / "broken-1.0.dist-info"
    metadata.mkdir()
    (metadata / "METADATA").write_text("Metadata-Version: 2.1\nName: broken\nVersion: 1.0\n")
    entries = {"raises": "raises", "ends": "ends", "a b": "raises", "absent": "absent.task", "odd": "!"}
    lines = [f"{name} = {module}" for name, module in entries.items()]
    (metadata / "entry_points.txt").write_text("\n".join([f"[lerobot_bimanual.{group}]", *lines]))
    (tmp_path / "raises.py").write_text("raise RuntimeError('\\x1b[2J' + 'x' * 10**6)")
    (tmp_path / "ends.py").write_text("raise SystemExit(0)")
    program = "import sys, lerobot_env_bimanual; from lerobot_bimanual.cli import main; sys.exit(main(sys.argv[1:]))"
    every = ["task", "list" if group == "tasks" else "perturbations"]
    for words, skipped in (
        (every, {"raises", "ends", "absent"}),
        (["task", "list", "--task=lift_ball"], set()),
    ):
        done = subprocess.run(
            [sys.executable, "-c", program, *words],
            env=os.environ | {"PYTHONPATH": str(tmp_path)},
            capture_output=True,
            text=True,
            cwd=tmp_path,
        )
        assert not done.returncode, done.stderr
        assert {name for name in entries if f"'{name}' cannot be loaded" in done.stderr} == skipped
        assert ("the task 'a b' of the distribution 'broken' has no name" in done.stderr) == (
            group == "tasks"
        )
        assert "\x1b" not in done.stderr
        assert len(done.stderr) < 5000


def test_a_module_that_registers_no_task_of_its_entry_s_name_is_named(monkeypatch):
    monkeypatch.setitem(TASKS.modules, "juggle", "json")
    with pytest.raises(BimanualError, match="module 'json' registers no task called 'juggle'"):
        get_task("juggle")

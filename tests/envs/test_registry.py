"""Registries of tasks and of axes of perturbation."""

import json
import os
import subprocess
import sys
from dataclasses import dataclass, replace

import numpy as np
import pytest

from lerobot_bimanual.errors import BimanualError, InvalidChoice
from lerobot_env_bimanual.commands.task_list import TaskListConfig, task_list
from lerobot_env_bimanual.conditions import Above, Condition
from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.experts.world_version import world_version
from lerobot_env_bimanual.options import EnvOptions
from lerobot_env_bimanual.perturbations.axis import Axis, data
from lerobot_env_bimanual.perturbations.axis import register as register_axis
from lerobot_env_bimanual.props.box import Box
from lerobot_env_bimanual.registry import AXES
from lerobot_env_bimanual.task import Task, Variation
from lerobot_env_bimanual.tasks.registry import (
    TASKS,
    get_task,
    list_suites,
    list_tasks,
    register,
    resolve_tasks,
)


@dataclass(frozen=True)
class InAnyOf(Condition):
    """A condition of another author."""

    props: frozenset[str]

    def __call__(self, view):
        return False


ALTERNATIVES = ("symmetric asymmetric", "synchronous asynchronous", "prehensile non_prehensile mixed")


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"name": "new_name"}, "ids below 1000 belong to built-in tasks"),
        ({"id": 1099}, "'push_box', which belongs to a built-in task"),
    ],
)
def test_a_second_task_with_the_same_name_or_id_is_refused(changes, message):
    original = type(get_task("push_box"))
    twin = type("Twin", (original,), {"spec": replace(original.spec, **changes)})
    with pytest.raises(ValueError, match=message):
        register(twin)
    assert get_task("push_box").__class__ is original


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        (
            {"instructions": "push"},
            "instructions is 'push', but must be a tuple: one alone has a comma",
        ),
        ({"instructions": ()}, "instructions are empty"),
        ({"variations": ()}, "variations are empty"),
        ({"plans": ()}, "plans are empty"),
        (
            {"plans": ("left", "right"), "script": lambda self, scene, variation: ()},
            "script has no argument `plan`",
        ),
        (
            {"conditions": lambda self, variation: iter(self.spec.success)},
            "conditions are .* must be a tuple",
        ),
        ({"props": (Box("distractor_box", (0.1, 0.1, 0.1), 1.0, 0.5),)}, "a prop is called 'distractor_box'"),
        ({"plans": "left"}, "plans is 'left', but must be a tuple"),
        ({"varied": (Above("box", 1.0),)}, "varied must be a tuple of sets of props"),
        ({"success": ()}, "success is empty, so that every episode would be solved"),
        ({"horizon_ticks": 0}, "horizon_ticks is 0, but must be at least 1"),
        ({"instructions": ("push {what}",)}, "names 'what', which variation 0 has no word for"),
        ({"variations": (Variation(), Variation())}, r"indices \[0, 0\], but must have \[0, 1\]"),
        ({"success": (Above("box", 1.0),) * 2}, r"two are called above\(box, 1.00\)"),
    ],
)
def test_a_task_whose_data_contradict_each_other_is_refused(changes, message):
    original = type(get_task("push_box"))
    methods = {name: changes[name] for name in ("script", "conditions") if name in changes}
    data = {name: value for name, value in changes.items() if name not in methods}
    spec = replace(original.spec, name="new_name", id=1099, **data)
    with pytest.raises(ValueError, match=message):
        register(type("New", (original,), {"spec": spec, "conditions": Task.conditions} | methods))


def test_two_tasks_of_other_distributions_may_not_have_the_same_id(monkeypatch):
    monkeypatch.setattr(TASKS, "loaded", dict(TASKS.loaded))
    original = type(get_task("push_box"))
    one, two = (
        type(name, (original,), {"spec": replace(original.spec, name=name, id=1099)})
        for name in ("one", "two")
    )
    register(one)
    with pytest.raises(ValueError, match="task 'two' has the id of 'one'"):
        register(two)


def test_names_resolve_in_order_unknown_names_are_refused_and_alternative_suites_are_disjoint():
    for ask in (get_task, resolve_tasks):
        message = r"'push_boxes', .*handover_item_easy, lift_ball.*push_box.* Did you mean 'push_box'\?"
        with pytest.raises(InvalidChoice, match=message):
            ask("push_boxes")
    with pytest.raises(InvalidChoice, match="task is ''"):
        resolve_tasks([])
    assert resolve_tasks("push_box, lift_ball,push_box") == ("push_box", "lift_ball")
    assert resolve_tasks(["lift_ball", "all"])[0] == "lift_ball"
    assert sorted(resolve_tasks("all")) == list(list_tasks())
    suites = list_suites()
    for name in list_tasks():
        found = {suite for suite, tasks in suites.items() if name in tasks}
        assert {*get_task(name).spec.suites} == found - {"all", "two_armed"} != found
        for alternatives in ALTERNATIVES:
            assert len(found & {*alternatives.split()}) == 1, name


def test_the_verb_lists_every_task_for_programs(capsys):
    task_list(TaskListConfig(format="json"))
    rows = {row["name"]: row for row in json.loads(capsys.readouterr().out)}
    assert sorted(rows) == list(list_tasks())
    assert rows["lift_ball"]["instructions"] == [["lift the ball"]]
    assert rows["lift_ball"]["success"][0][0] == "above(ball, 0.95)"
    assert rows["push_box"]["suites"][-1] == "non_prehensile"


ALL_TASKS = "from lerobot_bimanual.cli import main; raise SystemExit(main(['task', 'list']))"
ALL_AXES = "from lerobot_env_bimanual.sweep.conditions import conditions_of; conditions_of('lift_ball')"
ONE_TASK = ALL_TASKS.replace("'list'", "'list', '--task=lift_ball'")


@pytest.mark.parametrize(
    ("group", "every", "ours"), [("tasks", ALL_TASKS, "lift_ball"), ("perturbations", ALL_AXES, "mass")]
)
def test_what_is_broken_in_another_distribution_is_a_warning_and_nothing_more(group, every, ours, tmp_path):
    metadata = tmp_path / "broken-1.0.dist-info"
    metadata.mkdir()
    (metadata / "METADATA").write_text("Metadata-Version: 2.1\nName: broken\nVersion: 1.0\n")
    entries = {"raises": "raises", "ends": "ends", "a b": "raises", "absent": "absent.task", "odd": "!"}
    entries |= {"lift_ball": "raises", "mass": "raises"}  # names of ours
    lines = [f"{name} = {module}" for name, module in entries.items()]
    (metadata / "entry_points.txt").write_text("\n".join([f"[lerobot_bimanual.{group}]", *lines]))
    (tmp_path / "raises.py").write_text("raise RuntimeError('\\x1b[2J' + 'x' * 10**6)")
    (tmp_path / "ends.py").write_text("raise SystemExit(0)")
    for program, skipped in ((every, {"raises", "ends", "absent"}), (ONE_TASK, set())):
        done = subprocess.run(
            [sys.executable, "-c", program],
            env=os.environ | {"PYTHONPATH": str(tmp_path)},
            capture_output=True,
            text=True,
            cwd=tmp_path,
        )
        assert not done.returncode, done.stderr
        found = {name for name in entries if f"'{name}' cannot be loaded" in done.stderr}
        assert found == (skipped | ({"mass", "lift_ball"} - {ours} if skipped else set()))
        assert (
            f"'{ours}' of the distribution 'broken' has the name of a built-in one" in done.stderr
            or not skipped
        )
        assert ("the task 'a b' of the distribution 'broken' must be called by" in done.stderr) == (
            group == "tasks"
        )
        assert "\x1b" not in done.stderr
        assert len(done.stderr) < 5000


def test_a_module_that_registers_no_task_of_its_entry_s_name_is_named(monkeypatch):
    monkeypatch.setitem(TASKS.modules, "juggle", "json")
    with pytest.raises(BimanualError, match="module 'json' registers no task called 'juggle'"):
        get_task("juggle")


@pytest.mark.parametrize("name", AXES.names)
def test_every_axis_says_what_it_does_how_far_and_why(name):
    axis = AXES.get(name)
    assert axis.name == name
    assert len(axis.levels) == 3
    assert axis.unit
    assert axis.summary
    assert axis.source
    differences = np.diff([1.0 if axis.unit.startswith("times") else 0.0, *axis.levels])
    assert (differences > 0).all() or (differences < 0).all(), "level 0 comes before level 1 on the same dial"
    assert any((axis.build, axis.begin, axis.look, axis.see, axis.command, axis.disturb))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"levels": (1.0, 2.0)}, "must be 3 magnitudes"),
        ({"group": "mine"}, "group is 'mine', but must be one of: seen, clutter"),
        ({}, "the axis changes nothing: give it build"),
        ({"group": "seen", "command": lambda context, action: action}, "'seen', which moves nothing"),
    ],
)
def test_an_axis_whose_data_contradict_each_other_is_refused(changes, message):
    with pytest.raises(ValueError, match=message):
        register_axis(Axis(**data("mass") | {"name": "new_name"} | changes))


def test_perturb_is_normalised_and_unknown_inapplicable_or_duplicate_axes_are_refused():
    assert EnvOptions(perturb="mass:1, arm_late:2").perturb == "arm_late:2,mass:1"
    assert EnvOptions(perturb="mass:0").perturb == EnvOptions().perturb == ""
    with pytest.raises(InvalidChoice, match=r"'masss', but must be one of: .*mass"):
        BimanualEnv("lift_ball", perturb="masss:1")
    env = BimanualEnv("dual_push_buttons", obs="state", perturb="mass:1")
    with pytest.raises(InvalidChoice, match=r"for 'dual_push_buttons' is 'mass', but must be .*arm_late"):
        env.reset(seed=0)
    mass = AXES.get("mass")
    with pytest.raises(ValueError, match="another axis is called 'mass'"):
        register_axis(mass)


def test_a_condition_with_thresholds_outside_its_fields_has_no_version(monkeypatch):
    class Higher(Condition):
        def __init__(self, height_m: float):
            object.__setattr__(self, "height_m", height_m)

        def __call__(self, view):
            return False

    monkeypatch.setattr(type(get_task("push_box")), "conditions", lambda self, variation: (Higher(1.0),))
    with pytest.raises(BimanualError, match="Higher of push_box has height_m outside its fields"):
        world_version.__wrapped__("push_box")


def test_a_condition_whose_text_differs_between_processes_has_no_version(monkeypatch):
    strange = (InAnyOf(frozenset({"box", "table"})),)
    monkeypatch.setattr(type(get_task("push_box")), "conditions", lambda self, variation: strange)
    with pytest.raises(BimanualError, match=r"InAnyOf\.props of push_box is frozenset"):
        world_version.__wrapped__("push_box")


def test_a_perturbed_or_varied_world_has_a_version_of_its_own_even_if_it_only_looks_different():
    worlds = (("",), ("mass:1",), ("camera_moved:1",), ("camera_moved:2",), ("", "varied"))
    assert len({world_version("lift_ball", *world) for world in worlds}) == len(worlds)

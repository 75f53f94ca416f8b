import numpy as np
import pytest

from lerobot_bimanual.errors import InvalidChoice
from lerobot_env_bimanual.commands.task_list import TaskPerturbationsConfig, task_perturbations
from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.experts.world_version import world_version
from lerobot_env_bimanual.options import EnvOptions
from lerobot_env_bimanual.perturbations.axis import Axis, data, register
from lerobot_env_bimanual.registry import AXES


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


def test_options_hold_perturbations_in_their_one_form():
    assert EnvOptions(perturb="mass:1, arm_late:2").perturb == "arm_late:2,mass:1"
    assert EnvOptions(perturb="mass:0").perturb == EnvOptions().perturb == ""


def test_an_axis_that_does_not_exist_or_has_nothing_to_change_is_refused_with_those_that_do():
    with pytest.raises(InvalidChoice, match=r"'masss', but must be one of: .*mass"):
        BimanualEnv("lift_ball", perturb="masss:1")
    env = BimanualEnv("dual_push_buttons", obs="state", perturb="mass:1")
    with pytest.raises(
        InvalidChoice, match=r"for 'dual_push_buttons' is 'mass', but must be one of: .*arm_late"
    ):
        env.reset(seed=0)


def test_two_axes_of_one_name_are_refused():
    AXES.get("mass")
    with pytest.raises(ValueError, match="another axis is called 'mass'"):
        register(Axis(**data("mass")))


def test_a_perturbed_world_has_a_version_of_its_own_even_if_it_only_looks_different():
    versions = [
        world_version("lift_ball", perturb) for perturb in ("", "mass:1", "camera_moved:1", "camera_moved:2")
    ]
    assert len(set(versions)) == len(versions)


def test_all_axes_are_listed_with_their_levels_or_those_of_a_group(capsys):
    task_perturbations(TaskPerturbationsConfig())
    listed = capsys.readouterr().out
    assert [line.split()[0] for line in listed.splitlines() if line[0] != " "] == list(AXES.names)
    task_perturbations(TaskPerturbationsConfig(group="words"))
    listed = capsys.readouterr().out
    assert listed.startswith("instruction  (words)")
    assert "levels 1 to 3: 1, 2, 3 steps" in listed

"""Tasks that can be done in several ways: which one is demonstrated, and that both arms must go the same one."""

import json
import re
from functools import partial
from itertools import product

import numpy as np
import pytest
from planted_failures import evaluation, expert_keyposes, played

from lerobot_bimanual.errors import InvalidChoice, PlacementFailure
from lerobot_bimanual.keypose_layout import ARM_KEYPOSE_DIM
from lerobot_bimanual.results.protocols import PROTOCOLS
from lerobot_env_bimanual.commands.dataset_generate import DatasetGenerateConfig, settings_of
from lerobot_env_bimanual.commands.expert_evaluate import ExpertEvaluateConfig, expert_evaluate
from lerobot_env_bimanual.commands.results_diagnose import ResultsDiagnoseConfig, results_diagnose
from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.experts import plans
from lerobot_env_bimanual.experts.baselines import mixed
from lerobot_env_bimanual.experts.runner import expert, run_episode
from lerobot_env_bimanual.failures.agreement import plans_of_arms
from lerobot_env_bimanual.tasks.registry import get_task, list_tasks

TASKS = [name for name in list_tasks() if len(get_task(name).spec.plans) > 1]
FIRST_SEED = 2_150_000


@pytest.fixture(scope="module", params=TASKS)
def env(request):
    """Just reset to a scene that allows all plans."""
    env = BimanualEnv(request.param, obs="state")
    for seed in range(FIRST_SEED, FIRST_SEED + 20):
        env.reset(seed=seed)
        if plans.infeasible_plan(env) is None:
            break
    else:
        pytest.fail("none of 20 scenes allows all plans")
    return env


def test_the_first_choice_of_each_arm_tells_its_plan(env):
    by_plan = [[keypose.to_vector() for keypose in plans.keyposes_by(env, plan)] for plan in range(2)]
    for left, right in product(range(2), repeat=2):
        halves = zip(by_plan[left], by_plan[right], strict=False)
        actions = [np.append(one[:ARM_KEYPOSE_DIM], other[ARM_KEYPOSE_DIM:]) for one, other in halves]
        assert plans_of_arms(env, actions) == [left, right]
    assert plans_of_arms(env, []) == [None, None]
    assert len(set(env.task_definition.spec.plans)) == len(env.task_definition.spec.plans) == 2


@pytest.mark.slow
def test_each_plan_solves_its_task_and_arms_that_follow_different_ones_do_not(env):
    seed, count = env.progress.seed, len(env.task_definition.spec.plans)
    assert all(run_episode(env, seed, expert(plan=plan)).success for plan in range(count))
    rngs = [np.random.default_rng(number) for number in range(4)]
    firsts = [int(np.random.default_rng(number).permutation(count)[0]) for number in range(4)]
    assert set(firsts) == set(range(count))  # either arm takes either plan
    assert not any(run_episode(env, seed, partial(mixed, rng=rng)).success for rng in rngs)


def test_a_scene_that_does_not_allow_all_plans_is_refused_and_the_missing_plan_is_named():
    env = BimanualEnv("dual_push_buttons", obs="state")
    lacking = []
    for seed in range(FIRST_SEED, FIRST_SEED + 8):
        env.reset(seed=seed)
        try:
            assert next(plans.demonstrator(env, 1)).name == "above"
        except PlacementFailure as failure:
            lacking.append(str(failure))
    assert 0 < len(lacking) < 8
    assert all(reason.startswith("plan 'swapped': ") for reason in lacking)
    with pytest.raises(InvalidChoice, match="plan is 2, but must be one of: 0, 1"):
        next(plans.demonstrator(env, 2))


def test_a_plan_that_a_task_lacks_is_refused_with_a_list_of_its_plans(tmp_path):
    assert {*PROTOCOLS["plans"].tasks} == {*TASKS}
    with pytest.raises(InvalidChoice, match=r"plan of push_box is 2.*0 \(one stroke\), 1 \(two strokes\)"):
        expert_evaluate(ExpertEvaluateConfig(task="push_box", plan=2))
    with pytest.raises(InvalidChoice, match=r"plan of handover_item is 1.*0 \(usual\)"):
        expert_evaluate(ExpertEvaluateConfig(task="lift_ball,handover_item", player="mixed"))
    with pytest.raises(InvalidChoice, match="plans of handover_item is 'several', but must be one of: one"):
        settings_of(DatasetGenerateConfig(task="handover_item", plans="several", root=tmp_path))


@pytest.mark.slow
def test_a_diagnosis_says_how_often_both_arms_follow_one_plan_in_scenes_that_allow_all(tmp_path, capsys):
    task, env = "dual_push_buttons", BimanualEnv("dual_push_buttons", obs="state")
    allowing, lacking = list[int](), list[int]()
    for seed in range(FIRST_SEED, FIRST_SEED + 20):
        env.reset(seed=seed, options={"variation": 0})
        (lacking if plans.infeasible_plan(env) else allowing).append(seed)
    players = [expert(), expert(plan=1), partial(mixed, rng=np.random.default_rng(0)), expert()]
    pairs = zip([*allowing[:3], lacking[0]], players, strict=True)
    episodes = [played(task, expert_keyposes(task, player, seed), seed) for seed, player in pairs]
    record = evaluation(task, {"split": "test"}, *sorted(episodes, key=lambda episode: episode.seed))
    record.write(path := tmp_path / "record.json")
    output = tmp_path / "found.json"
    assert results_diagnose(ResultsDiagnoseConfig(results=path, output=output, workers=1)) == 0
    assert re.search(r"record +2/3 \(.*\) +2 +0 +0, 0: 1; (0, 1|1, 0): 1; 1, 1: 1\n", capsys.readouterr().out)
    choices = json.loads(output.read_text())["first_choices"]
    assert [one["seed"] for one in choices] == allowing[:3]

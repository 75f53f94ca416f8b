"""The expert solves the task, and a seed determines where it begins."""

from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.experts.runner import expert, run_episode


def test_the_expert_solves_the_task_and_a_seed_determines_the_start() -> None:
    """From every placement that it is given."""
    import raise_block  # noqa: F401  registers the task

    env = BimanualEnv("raise_block", obs="state", split="val")
    starts = []
    for _ in range(2):
        env.reset(seed=0)
        starts.append(env.state_hash())
    outcomes = [run_episode(env, seed, expert()) for seed in range(3)]
    env.close()
    assert starts[0] == starts[1]
    assert not [outcome.failure for outcome in outcomes if not outcome.success]

"""The expert solves the task."""

from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.experts.runner import expert, run_episode


def test_the_expert_solves_the_task() -> None:
    """From every placement that it is given."""
    import raise_block  # noqa: F401  registers the task

    env = BimanualEnv("raise_block", obs="state", split="val")
    outcomes = [run_episode(env, seed, expert()) for seed in range(3)]
    env.close()
    assert not [outcome.failure for outcome in outcomes if not outcome.success]

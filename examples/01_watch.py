"""Watch an expert solve a task: writes a smooth mp4 of its motion and prints what happened.

python examples/01_watch.py --task=lift_ball --seed=3 --output=outputs/watch
"""

import argparse

from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.experts.runner import expert, run_episode

parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
parser.add_argument("--task", default="lift_ball")
parser.add_argument("--seed", type=int, default=0)
parser.add_argument("--output", default="outputs/watch")
arguments = parser.parse_args()

env = BimanualEnv(arguments.task, obs="state", control_mode="keypose", video_dir=arguments.output)
outcome = run_episode(env, arguments.seed, expert(), lambda move: print(f"  {move.name}"))
env.close()
print("solved" if outcome.success else f"failed: {outcome.failure}", f"after {outcome.ticks / 20:.1f} s")
print(f"video in {arguments.output}")

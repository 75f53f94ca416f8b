"""What learning costs before and now: a training step of the small policies, and decoding a dataset into memory.

Each job runs in turn in two processes, one with this tree and one with an older one, A B A B, and counts the CPU
seconds of one thread. Steps are those of the small recipes on five 128 px cameras, as `lerobot-bimanual-train` makes
them: augmentation, network, clipping, optimizer. Prints one JSON line per job: medians and their ratio old to new.

    python benchmarks/learning.py --before=../older                                  # all policies
    python benchmarks/learning.py --before=../older --root=data/lift_ball/keyframes  # decoding, too
"""

import argparse
import json
import os
import statistics
import subprocess
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
POLICIES = ("peract2", "peract_lf", "peract_independent", "rvt_lf")

STEP = """
import sys, time, torch
torch.set_num_threads(1)
from policy_jobs import Setting, policy_job, small_flags
from lerobot_policy_bimanual.training.memory import keep_freed_memory
keep_freed_memory()
torch.manual_seed(0)
policy, repeats = sys.argv[1], int(sys.argv[2])
job = policy_job(policy, small_flags(policy), Setting(25, 8, "cpu", True))
for _ in range(2):
    job()
for _ in range(repeats):
    start = time.process_time()
    job()
    print("seconds", time.process_time() - start)
"""

DECODE = """
import sys, time, torch
torch.set_num_threads(1)
from lerobot.datasets.lerobot_dataset import LeRobotDataset
from lerobot_policy_bimanual.training.resident_dataset import ResidentDataset
dataset = LeRobotDataset("local/benchmark", root=sys.argv[1], return_uint8=True)
start = time.process_time()
ResidentDataset(dataset, torch.device("cpu"))
print("seconds", time.process_time() - start)
"""


def seconds(tree: Path, program: str, *arguments: str) -> list[float]:
    """CPU seconds that a program prints, with the packages of a tree."""
    paths = [tree, tree / "envs", tree / "policies", tree / "benchmarks"]
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(map(str, paths)), "OMP_NUM_THREADS": "1"}
    command = [sys.executable, "-c", program, *arguments]
    done = subprocess.run(command, env=environment, check=True, capture_output=True, text=True, cwd="/")
    return [float(line.split()[1]) for line in done.stdout.splitlines() if line.startswith("seconds ")]


def compare(job: str, before: Path, turns: int, program: str, *arguments: str) -> None:
    """Run both trees in turn, and print what came out."""
    taken: dict[str, list[float]] = {"before": [], "now": []}
    for _ in range(turns):
        taken["before"] += seconds(before, program, *arguments)
        taken["now"] += seconds(HERE.parent, program, *arguments)
    medians = {name: statistics.median(values) for name, values in taken.items()}
    print(json.dumps({"job": job, **medians, "ratio": medians["before"] / medians["now"]}), flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--before", type=Path, default=HERE.parent, help="tree to compare with")
    parser.add_argument("--policies", nargs="*", default=POLICIES, metavar="TYPE")
    parser.add_argument("--root", type=Path, help="a view of a dataset, to decode")
    parser.add_argument("--turns", type=int, default=2)
    parser.add_argument("--steps", type=int, default=6, help="per turn")
    options = parser.parse_args()
    before = options.before.resolve()
    if options.root:
        compare("decode", before, options.turns, DECODE, str(options.root.resolve()))
    for policy in options.policies:
        compare(policy, before, options.turns, STEP, policy, str(options.steps))


if __name__ == "__main__":
    main()

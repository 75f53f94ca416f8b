"""The network at its full width learns four demonstrations by heart, and then plays their placements.

It shows that the default sizes (66 million parameters) learn at all, through LeRobot's own `lerobot-train` and `lerobot-eval`.
Repeated, the command goes on where it stopped; with more `--steps`, training goes on. Other flags go to a new
training as they are.

    python benchmarks/full_width.py --device=cuda --policy.dtype=bfloat16
"""

import argparse
import json
import os
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

EPISODES = 4
NETWORK = (
    "--policy.type=peract2",
    "--policy.push_to_hub=false",
    # Hands reach other places than an expert's by up to half a voxel: scenes that are moved a little prepare for that.
    "--policy.augmentation_shift_m=[0.04,0.04,0.0]",
    "--policy.augmentation_yaw_deg=0",
    "--policy.optimizer_lr=2e-4",
    "--policy.lr_schedule=constant",  # so that more steps go on as if they had been asked for at first
)
LOADING = ("--num_workers=1", "--log_freq=20")


def run(words: list[str], log: Path) -> None:
    """Run a program of this environment, and keep what it prints."""
    print("$", shlex.join(words), flush=True)
    words = [str(Path(sys.executable).with_name(words[0])), *words[1:]]
    variables = {"HF_HUB_OFFLINE": "1"} | os.environ
    with log.open("a") as kept:
        printed = subprocess.Popen(
            words, env=variables, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
        )
        for line in printed.stdout or ():
            kept.write(line)
            print(line, end="", flush=True)
    if code := printed.wait():
        sys.exit(f"{Path(words[0]).name} ended with code {code}; the same command goes on where it stopped")


def train(options: argparse.Namespace, further: list[str]) -> Path:
    """Train up to a number of steps, from the last checkpoint on if there is one, and keep the last."""
    folder = options.folder / f"voxels{options.voxels}"
    last = folder / "checkpoints/last"
    words = ["lerobot-train", f"--steps={options.steps}", f"--save_freq={options.save_freq}"]
    if last.exists():
        words += ["--resume=true", f"--config_path={last}/pretrained_model/train_config.json"]
    else:
        shutil.rmtree(folder, ignore_errors=True)  # of a training that ended before its first checkpoint
        words += [*NETWORK, f"--policy.voxel_size={options.voxels}", f"--policy.device={options.device}"]
        words += ["--dataset.repo_id=local/demonstrations", f"--dataset.root={options.folder}/demonstrations"]
        words += [f"--batch_size={options.batch_size}", f"--output_dir={folder}", *LOADING, *further]
    if not last.exists() or int(last.resolve().name) < options.steps:
        run(words, options.folder / "train.log")
    for checkpoint in (folder / "checkpoints").iterdir():  # each takes 0.8 GB
        if checkpoint.is_dir() and checkpoint.resolve() != last.resolve():
            shutil.rmtree(checkpoint)
    return last


def main() -> None:
    arguments = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    arguments.add_argument("--task", default="lift_ball")
    arguments.add_argument("--device", default="cpu")
    arguments.add_argument("--voxels", type=int, default=50, help="per axis, a multiple of 5")
    arguments.add_argument("--steps", type=int, default=400, help="in all, over repetitions")
    arguments.add_argument("--save_freq", type=int, default=100, help="steps that an interruption may cost")
    arguments.add_argument("--batch_size", type=int, default=4)
    arguments.add_argument("--folder", type=Path, default=Path("outputs/full_width"))
    options, further = arguments.parse_known_args()
    options.folder.mkdir(parents=True, exist_ok=True)
    log, size = options.folder / "train.log", "image_size=128"
    demonstrations = [f"--episodes={EPISODES}", f"--{size}", f"--root={options.folder}/demonstrations"]
    run(["lerobot-bimanual", "dataset", "generate", f"--task={options.task}", *demonstrations], log)
    last = train(options, further)
    scores = options.folder / f"eval{last.resolve().name}"
    env = [
        "--env.type=bimanual",
        f"--env.task={options.task}",
        f"--env.{size}",
        "--env.split=train",
        "--seed=0",
    ]
    numbers = [f"--eval.n_episodes={EPISODES}", f"--eval.batch_size={EPISODES}"]
    episodes = [*numbers, "--eval.use_async_envs=false"]
    policy = [f"--policy.path={last}/pretrained_model", f"--policy.device={options.device}"]
    run(["lerobot-eval", *policy, *env, *episodes, f"--output_dir={scores}"], log)
    scored = json.loads((scores / "eval_info.json").read_text())["overall"]
    successes = round(EPISODES * scored["pc_success"] / 100)
    logged = re.findall(r"\bloss:(\S+).*?updt_s:(\S+) data_s:(\S+)(?:.*?mem_gb:(\S+))?", log.read_text())
    loss, update_s, data_s, memory = logged[-1]
    speed = 1 / (float(update_s) + float(data_s))
    figures = {"steps": int(last.resolve().name), "loss": float(loss), "steps/s": speed}
    figures |= {"GPU memory, GB": float(memory)} if memory else {}
    title = f"full width, {options.voxels} voxels, {options.device}"
    print(json.dumps({"benchmark": title, "figures": {options.task: figures | {"solved of 4": successes}}}))
    if successes < EPISODES:
        words = [word for word in sys.argv if not word.startswith("--steps=")]
        print(f"next: python {shlex.join(words)} --steps={2 * options.steps}")


if __name__ == "__main__":
    main()

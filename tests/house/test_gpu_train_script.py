"""benchmarks/gpu_train.sh trains as many steps as fit into the minutes; its programs are replaced by ones that log calls."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from lerobot_bimanual.benchmark.config import BenchmarkConfig
from lerobot_bimanual.benchmark.plan import Plan

SCRIPT = Path(__file__).parents[2] / "benchmarks" / "gpu_train.sh"
SECONDS_PER_STEP = 0.5
PLAN = f"{sys.executable} -c 'from lerobot_bimanual.cli import main; main()'"
PROGRAMS = {
    # A dry run is the real one.
    "lerobot-bimanual": f"""\
        for word; do [[ $word != --dry_run=true ]] || exec {PLAN} "$@"; done
        printf '%s\\n' "lerobot-bimanual $*" >>calls""",
    "lerobot-bimanual-train": f"""\
        printf '%s\\n' "train $*" >>calls
        echo "step:20 updt_s:99.0 data_s:0.1 smp/s:1"
        echo "step:40 updt_s:{SECONDS_PER_STEP - 0.1} data_s:0.1 smp/s:1" >&2""",
}


@pytest.fixture
def run(tmp_path: Path):
    """Runs the script with the programs above, and says how they were called."""
    programs = tmp_path / "programs"
    programs.mkdir()
    for name, text in PROGRAMS.items():
        (programs / name).write_text(f"#!/usr/bin/env bash\n{text}\n")
        (programs / name).chmod(0o755)

    def call(*words: str) -> list[str]:
        environment = os.environ | {"PATH": f"{programs}:{os.environ['PATH']}", "DEVICE": "cpu"}
        (tmp_path / "calls").unlink(missing_ok=True)
        subprocess.run([SCRIPT, *words], check=True, cwd=tmp_path, env=environment, capture_output=True)
        return (tmp_path / "calls").read_text().splitlines()

    return call


def test_the_last_steps_are_measured_and_as_many_trained_as_fit(run, tmp_path):
    output = tmp_path / "a folder"
    flags = (f"--output={output}", "--task=push_box")
    doctor, generation, trial, benchmark = run("run", "-", "2", *flags)
    steps = 4 * int(2 * 60 / SECONDS_PER_STEP / 4)
    assert doctor == "lerobot-bimanual doctor"
    assert generation.startswith("lerobot-bimanual dataset generate --task=push_box")
    plan = Plan.of(BenchmarkConfig(task="push_box", device="cpu", output=output))
    assert f"--dataset.root={plan.dataset}" in trial
    assert str(plan.run_folder) not in trial.rpartition("--output_dir=")[2]
    expected = ("--device=cpu", *flags, f"--steps={steps}", f"--save_freq={steps // 4}")
    assert benchmark.split("--device", 1)[1] == " ".join(expected).split("--device", 1)[1]

    # The second time there is a dataset, and the number of steps is kept: a checkpoint resumes only with the same number.
    plan.dataset.mkdir(parents=True)
    assert run("run", "-", "2", *flags) == [doctor, benchmark]

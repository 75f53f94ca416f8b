"""What a command keeps on disk between its processes is gone when it has ended, or at the latest with the next one."""

import subprocess
import sys
from pathlib import Path

import pytest

HOLD = "from lerobot_env_bimanual.scratch import use_scratch_folder as u; print(u(), flush=True); input()"


@pytest.fixture
def command(tmp_path):
    """Starts a process that has a scratch folder; gives it and its folder."""
    running = []

    def start() -> tuple[subprocess.Popen, Path]:
        process = subprocess.Popen(
            [sys.executable, "-c", HOLD],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            env={"TMPDIR": str(tmp_path)},
        )
        running.append(process)
        assert process.stdout is not None
        return process, Path(process.stdout.readline().strip())

    yield start
    for process in running:
        process.kill()
        process.communicate()


def test_the_folder_of_a_killed_process_goes_with_the_next_and_that_of_a_living_one_stays(
    command, tmp_path
) -> None:
    killed, lost = command()
    living, kept = command()
    killed.kill()
    killed.wait()
    assert {lost, kept} == set(tmp_path.iterdir())
    ending, own = command()
    assert {kept, own} == set(tmp_path.iterdir())
    ending.communicate("\n")
    living.communicate("\n")
    assert not list(tmp_path.iterdir())


def test_nothing_but_own_folders_is_removed(command, tmp_path) -> None:
    elsewhere = tmp_path / "elsewhere"
    (elsewhere / "photos").mkdir(parents=True)
    (tmp_path / "lerobot_bimanual-link").symlink_to(elsewhere)
    (tmp_path / "lerobot_bimanual-file").touch()
    process, _ = command()
    process.communicate("\n")
    assert (elsewhere / "photos").is_dir()
    assert {path.name for path in tmp_path.iterdir()} == {
        "elsewhere",
        "lerobot_bimanual-link",
        "lerobot_bimanual-file",
    }

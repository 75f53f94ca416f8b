"""What a command keeps on disk between its processes is gone when it has ended, or at the latest with the next one."""

import subprocess
import sys
import tempfile
from pathlib import Path

import pytest

from lerobot_env_bimanual.scratch import PREFIX

HOLD = "from lerobot_env_bimanual.scratch import use_scratch_folder as u; print(u(), flush=True); input()"


@pytest.fixture
def place():
    """A temporary folder with a path that is short enough for a socket below it."""
    with tempfile.TemporaryDirectory(dir="/tmp") as folder:
        yield Path(folder)


@pytest.fixture
def command(place):
    """Starts a process that has a scratch folder; gives it and its folder."""
    running = []

    def start() -> tuple[subprocess.Popen, Path]:
        process = subprocess.Popen(
            [sys.executable, "-c", HOLD],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            env={"TMPDIR": str(place)},
        )
        running.append(process)
        assert process.stdout is not None
        return process, Path(process.stdout.readline().strip())

    yield start
    for process in running:
        process.kill()
        process.communicate()


def test_the_folder_of_a_killed_process_goes_with_the_next_and_that_of_a_living_one_stays(
    command, place
) -> None:
    killed, lost = command()
    living, kept = command()
    killed.kill()
    killed.wait()
    assert {lost, kept} == set(place.iterdir())
    ending, own = command()
    assert {kept, own} == set(place.iterdir())
    ending.communicate("\n")
    living.communicate("\n")
    assert not list(place.iterdir())


def test_nothing_but_own_folders_is_removed(command, place) -> None:
    elsewhere = place / "elsewhere"
    strangers = [elsewhere / "photos", place / "lerobot_bimanual-main", place / f"{PREFIX}mine"]
    for folder in strangers:
        folder.mkdir(parents=True)
        (folder / "thesis.tex").touch()
    (place / f"{PREFIX}link").symlink_to(elsewhere)
    (place / f"{PREFIX}file").touch()
    before = set(place.iterdir())
    process, _ = command()
    process.communicate("\n")
    assert set(place.iterdir()) == before
    assert all((folder / "thesis.tex").is_file() for folder in strangers)

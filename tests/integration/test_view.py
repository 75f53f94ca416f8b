"""The command `task view` and its files."""

from pathlib import Path

import numpy as np
import pytest
from test_video import read_frames

from lerobot_bimanual.cli import main
from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.rendering import film as films
from lerobot_env_bimanual.world.video import VideoWriter

CHECKPOINT = Path(__file__).parents[2] / "results/checkpoints/peract2_on_all"


@pytest.fixture(autouse=True)
def small_films_here(monkeypatch, tmp_path) -> None:
    monkeypatch.setattr(films, "SIZE", (48, 64))
    monkeypatch.chdir(tmp_path)


def frames(film: Path) -> np.ndarray:
    return read_frames(film).astype(float)


def test_a_video_is_written_and_its_outcome_told(capsys) -> None:
    assert main(["task", "view", "--task=lift_ball", "--first_seed=3", "--output=films"]) == 0
    outcome, file = capsys.readouterr().out.splitlines()
    assert outcome.startswith("expert: solved after ")
    film = Path(file)
    assert film == Path("films/lift_ball_v0_test_seed3_expert.mp4")
    pictures = frames(film)
    assert len(pictures) > 50
    assert all(np.abs(picture - pictures[-1]).mean() < 2 for picture in pictures[-20:])  # the last is held
    assert np.abs(pictures[0] - pictures[-1]).mean() > 1


def test_a_video_shows_the_perturbation_that_its_name_says() -> None:
    flags = ("--task=lift_ball", "--output=films", "--setting=varied", "--camera=right_shoulder")
    for perturb in ("", "light:3,arm_late:1"):
        assert main(["task", "view", *flags, f"--perturb={perturb}"]) == 0
    names = [f"lift_ball_v0_test_seed0_varied_{perturb}expert.mp4" for perturb in ("", "arm_late1_light3_")]
    nominal, dark = (frames(Path("films") / name)[0].mean((0, 1)) for name in names)
    assert np.abs(nominal - dark).max() > 5


def test_a_second_film_of_an_episode_is_turned_and_zoomed_like_the_first(monkeypatch) -> None:
    pictures, add = list[np.ndarray](), VideoWriter.add

    def note(writer: VideoWriter, rgb: np.ndarray) -> None:
        pictures.append(rgb)
        add(writer, rgb)

    monkeypatch.setattr(VideoWriter, "add", note)
    env = BimanualEnv("lift_ball", obs="state")
    rollouts = {"expert": films.rollout(env, 3, lambda _: iter(()))}
    for name in ("first", "second"):
        films.write_film(env, rollouts, Path(name))
    first, second = np.split(np.array(pictures), 2)
    assert np.array_equal(first, second)


@pytest.mark.slow
def test_a_film_with_a_checkpoint_shows_expert_and_policy_side_by_side(capsys) -> None:
    flags = ("--task=handover_item_easy", "--first_seed=1", "--output=films")
    assert main(["task", "view", *flags, f"--checkpoint={CHECKPOINT}"]) == 0
    assert "expert: solved after " in capsys.readouterr().out
    (film,) = Path("films").glob("*_expert_and_policy.mp4")
    assert frames(film)[0].shape[1] == 2 * films.SIZE[1]

"""Somebody at the viewer gets the episode that they ask for, and leaves when they like."""

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from lerobot_env_bimanual import viewer
from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.experts.runner import expert
from lerobot_env_bimanual.viewer import Key, Performance, Wish, no_window

pytestmark = pytest.mark.sim

CHOICES = (("",), ("light:2,mass:1",), ("light:1", "light:2", "light:3"), ("mass:1", "mass:2", "mass:3"))


class Screen:
    """A window that notes what it shows, and presses keys when it shows something for the first time.

    Args:
        presses: text to look for, and the keys that are pressed when it is there; then the next pair. The window is
            closed after the last.
    """

    def __init__(self, *presses: tuple[str, tuple[int, ...]]):
        self.presses = list(presses)
        self.shown: list[str] = []
        self.places: list[np.ndarray] = []
        self.lights: list[np.ndarray] = []
        self.opened = 0
        self.cam: Any = None
        self.model: Any = None
        self.data: Any = None

    @contextmanager
    def open(self, model: Any, data: Any, key_callback: Callable[[int], None]) -> Iterator["Screen"]:
        self.model, self.data, self.press = model, data, key_callback
        self.cam = SimpleNamespace(lookat=np.zeros(3), distance=0.0, azimuth=0.0, elevation=0.0)
        self.opened += 1
        yield self

    def is_running(self) -> bool:
        return bool(self.presses)

    def set_texts(self, texts: tuple) -> None:
        self.shown.append(texts[2])

    def sync(self) -> None:
        self.places.append(self.data.qpos.copy())
        self.lights.append(self.model.light_diffuse.copy())
        text, keys = self.presses[0]
        if text in self.shown[-1]:
            self.presses.pop(0)
            for key in keys:
                self.press(key)


def watched(screen: Screen, task: str = "handover_item", perturb: str = "", **options) -> Screen:
    def make_env(perturb: str) -> BimanualEnv:
        return BimanualEnv(task, obs="state", perturb=perturb, **options)

    wish = Wish(0, perturb=perturb)
    Performance(make_env, expert(), "expert", wish, CHOICES, screen.open, sleep=lambda _: None).run()
    return screen


def test_the_expert_plays_to_its_end_and_the_end_stays():
    screen = watched(Screen(("solved", ()), ("solved", ())), "lift_ball")
    assert "lift the ball\nexpert, seed 0, variation 0, the world as it is\n0.0 s" in screen.shown[0]
    assert np.abs(screen.places[0] - screen.places[-1]).max() > 0.1
    assert np.array_equal(screen.places[-1], screen.places[-2])
    assert screen.cam.distance > 1


def test_arrows_take_other_seeds_and_variations_in_the_middle_of_an_episode():
    screen = watched(
        Screen(
            ("0.3 s", (Key.RIGHT,)),
            ("seed 1, ", (Key.LEFT,)),
            ("seed 0, ", (Key.LEFT,)),  # there is none before the first
            ("seed 0, ", (Key.UP, Key.UP)),
            ("0.1 s", (Key.BACKSPACE,)),
            ("0.0 s", ()),
        ),
        variation=0,
    )
    assert not any("solved" in text for text in screen.shown)
    assert {text.splitlines()[1] for text in screen.shown} == {
        f"expert, {episode}, the world as it is"
        for episode in (
            "seed 0, variation 0",
            "seed 1, variation 0",
            "seed 0, variation 1",
            "seed 0, variation 2",
        )
    }
    assert screen.opened == 1


def test_page_keys_take_another_perturbation_of_the_same_episode_in_a_window_of_its_own():
    screen = Screen(
        ("0.1 s", (Key.UP,)),
        ("variation 1, the world as it is\n0.2 s", (Key.PAGE_DOWN,)),
        ("variation 1, with light:2,mass:1\n0.1 s", (Key.PAGE_DOWN,)),
        ("with light:1\n0.1 s", (Key.END,)),
        ("with light:2\n0.1 s", (Key.RIGHT,)),
        ("seed 1, variation 1, with light:2\n0.1 s", (Key.PAGE_UP,)),
        ("seed 1, variation 1, with light:2,mass:1\n0.0 s", ()),
    )
    watched(screen, variation=0)
    assert not screen.presses
    assert screen.opened == 5
    lights = {
        world: screen.lights[next(i for i, text in enumerate(screen.shown) if f"{world}\n0.1 s" in text)]
        for world in ("variation 0, the world as it is", "with light:1", "seed 0, variation 1, with light:2")
    }
    as_it_is, one, two = lights.values()
    assert np.abs(as_it_is - one).max() > 0.01
    assert np.abs(one - two).max() > 0.01


def test_somebody_who_has_turned_the_view_finds_it_turned_in_the_next_window():
    class Turned(Screen):
        def sync(self) -> None:
            if self.opened == 1:
                self.cam.azimuth, self.cam.lookat[2] = 33.0, 1.5
            super().sync()

    screen = watched(Turned(("0.1 s", (Key.PAGE_DOWN,)), ("with light:2,mass:1", ())))
    assert (screen.opened, screen.cam.azimuth, screen.cam.lookat[2]) == (2, 33.0, 1.5)


def test_keys_go_round():
    def after(wish: Wish, key: int) -> Wish | None:
        return wish.after(key, shown=4 if key == Key.UP else 0, variations=5, perturbations=CHOICES)

    assert after(Wish(3), Key.DOWN) == Wish(3, 4)
    assert after(Wish(3), Key.UP) == Wish(3, 0)
    assert after(Wish(3, 2), Key.PAGE_UP) == Wish(3, 2, "mass:1")
    assert after(Wish(3, 2, "mass:3"), Key.PAGE_DOWN) == Wish(3, 2)
    assert after(Wish(3, 2, "mass:3"), Key.END) == Wish(3, 2, "mass:1")
    assert after(Wish(3), Key.END) == Wish(3)
    assert after(Wish(3), ord("H")) is None


def test_space_stops_the_time_and_lets_it_go_on():
    screen = watched(Screen(("0.2 s", (Key.SPACE,)), ("paused", ()), ("paused", (Key.SPACE,)), ("0.3 s", ())))
    first, *_, last = (number for number, text in enumerate(screen.shown) if "paused" in text)
    assert all(np.array_equal(place, screen.places[first]) for place in screen.places[first:last])


def test_a_window_needs_a_display_that_opens(monkeypatch):
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    assert no_window() == "there is no display"
    monkeypatch.setitem(os.environ, "DISPLAY", ":4711")
    assert no_window() == "the display cannot be opened"


def test_the_keys_that_are_shown_are_those_that_do_something():
    for word in ("right/left", "up/down", "space", "backspace", "page down/up", "end"):
        assert word in viewer.KEYS

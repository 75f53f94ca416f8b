"""Axes that change how the scene looks, and how the task is said: `light`, ..., `instruction`, `sentences`."""

import colorsys
import functools
import re
import tomllib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lerobot_bimanual.geometry.rotations import quat_wxyz_from_axis_angle, quat_wxyz_to_matrix
from lerobot_env_bimanual.gl import mujoco
from lerobot_env_bimanual.perturbations.axis import Axis, Start, data, register
from lerobot_env_bimanual.task import TaskSpec
from lerobot_env_bimanual.world.appearance import Appearance
from lerobot_env_bimanual.world.arena import MAPLE, OAK_GREY, PAINT
from lerobot_env_bimanual.world.scene_view import SceneView
from lerobot_env_bimanual.world.textures import add_material, noise, to_image

LAMPS_TURN_RAD = np.deg2rad(150)
LAMPS_STOPS = 0.6
LAMPS_WARMTH = 0.3
"""Changes of the lamps at magnitude 1, relative ones for the warmth."""

HUE_TURN_RAD = np.deg2rad(150)
COLOUR_SHIFT = 0.35
"""Changes of the props at magnitude 1: a turn of all hues, and a shift of all colours in units of a channel."""
N_COLOUR_CHANGES = 16
"""Candidate changes that are drawn; the one that leaves the fewest colours unchanged is taken."""
UNCOLOURED = (0.5, 0.5, 0.5, 1.0)
"""Colour of a geom that has the colour of its material."""

MAX_HUES_DEG = {
    15: "red",
    45: "orange",
    70: "yellow",
    165: "green",
    190: "turquoise",
    225: "azure",
    260: "blue",
    320: "purple",
    345: "pink",
    360: "red",
}
"""Largest hue of a colour -> its name."""
MAX_VALUES = {0.25: "black", 0.8: "grey", 1.0: "white"}
"""Largest brightness of a colour without a hue -> its name."""
MIN_SATURATION = 0.3
COLOUR_NAMES = {*MAX_HUES_DEG.values(), *MAX_VALUES.values()}

SIDE_PIXELS = 128
SURFACES = {"table": (MAPLE, (2.0, 2.0)), "floor": (OAK_GREY, (6.0, 6.0)), "wall": (PAINT, (4.0, 2.5))}
"""Material of each, with its colour and how often a pattern is repeated along its sides."""
MIN_CHANNEL = 0.25
"""Smallest channel of a drawn colour, so that none is as strong as those of the things that language names."""
TINT = 0.9
"""Share of the way from a surface's own colour to a drawn one, at magnitude 1."""

type Templates = Mapping[str, Sequence[str]]
"""Sentences by level "1" to "3", and for "training"; like a task's instructions they are filled with the words of the variation."""
type Pattern = Callable[[NDArray, NDArray], NDArray]
"""Darkness (0..1) of pixels; rows and columns go from 0 to 1. Each pattern repeats without a seam."""


def _attach_ambient_light(model: mujoco.MjSpec, magnitude: float) -> None:
    """Have the ambient light, which belongs to no lamp, come from the last lamp."""
    even = model.visual.headlight
    model.lights[-1].ambient = even.ambient
    even.ambient = (0, 0, 0)


def _change_lamps(start: Start, appearance: Appearance) -> Appearance:
    """Turn the lamps about the table, dim or brighten them, make them warmer or colder; each to a drawn side."""
    model = start.scene.model
    side, strength, warmth = start.magnitude * start.rng.choice((-1, 1), size=3)
    turn = quat_wxyz_to_matrix(quat_wxyz_from_axis_angle((0, 0, 1), side * LAMPS_TURN_RAD))
    colour = 2 ** (strength * LAMPS_STOPS) * (1 + warmth * np.array([LAMPS_WARMTH, 0, -LAMPS_WARMTH]))
    centre = model.stat.center * (1, 1, 0)
    lit = appearance.with_fields(
        light_pos=centre + (model.light_pos - centre) @ turn.T,
        light_dir=model.light_dir @ turn.T,
        light_ambient=model.light_ambient * colour,
        light_diffuse=model.light_diffuse * colour,
    )
    return replace(lit, casts_shadows=start.magnitude == start.axis.levels[-1])


register(Axis(**data("light"), build=_attach_ambient_light, look=_change_lamps))


def colour_name(rgb: ArrayLike) -> str:
    """The English name of a colour of three channels 0..1."""
    hue, saturation, value = colorsys.rgb_to_hsv(*np.asarray(rgb, float).tolist())
    if saturation >= MIN_SATURATION and value >= min(MAX_VALUES):
        return next(word for limit, word in MAX_HUES_DEG.items() if hue * 360 <= limit)
    return next(word for limit, word in MAX_VALUES.items() if value <= limit)


def named_colours(spec: TaskSpec) -> set[str]:
    """Colours that occur in any instruction of a task."""
    sentences = [sentence for row in spec.variations for sentence in spec.instructions_for(row)]
    return COLOUR_NAMES.intersection(re.findall("[a-z]+", " ".join(sentences).lower()))


def _recolour_props(start: Start, appearance: Appearance) -> Appearance:
    """Draw one change for all props, so that things that share a colour still do, such as a rope's end and its plate.

    Colours that an instruction names, before or after the change, are kept: instructions tell things apart by them.
    """
    scene, rng, named = start.scene, start.rng, named_colours(start.task.spec)
    worn = appearance.fields.get("geom_rgba", scene.model.geom_rgba).copy()
    own, of_props = _own_colours(scene, worn), _of_props(scene)
    colours, which = np.unique(own[of_props], axis=0, return_inverse=True)
    which = which.ravel()  # NumPy 2.0.0 has it as a column
    levels = start.axis.levels
    draws = [(rng.choice((-1, 1)), _direction(rng)) for _ in range(N_COLOUR_CHANGES)]
    side, direction = min(draws, key=lambda draw: _named(colours, named, levels, *draw).sum())
    stays = _named(colours, named, levels, side, direction)
    changed = _changed(colours, start.magnitude, side, direction)
    worn[of_props, :3] = np.where(stays[which, None], worn[of_props, :3], changed[which])
    return appearance.with_fields(geom_rgba=worn)


def _named(
    colours: NDArray, named: set[str], levels: Sequence[float], side: float, direction: NDArray
) -> NDArray[np.bool_]:
    """Which colours (n, 3) are named now, or would be at any level."""
    at_levels = [colours, *(_changed(colours, level, side, direction) for level in levels)]
    return np.any([[colour_name(rgb) in named for rgb in level] for level in at_levels], axis=0)


def _direction(rng: np.random.Generator) -> NDArray:
    direction = rng.normal(size=3)
    return direction / np.linalg.norm(direction)


def _changed(rgb: NDArray, magnitude: float, side: float, direction: NDArray) -> NDArray:
    """Colours (n, 3) turned about grey and shifted."""
    turn = quat_wxyz_from_axis_angle(np.ones(3) / np.sqrt(3), side * magnitude * HUE_TURN_RAD)
    return np.clip(rgb @ quat_wxyz_to_matrix(turn).T + magnitude * COLOUR_SHIFT * direction, 0.02, 1)


def _own_colours(scene: SceneView, worn: NDArray) -> NDArray:
    """(ngeom, 3) colours of geoms, or of their materials where they have none of their own."""
    model = scene.model
    has_material = (worn == UNCOLOURED).all(axis=1) & (model.geom_matid >= 0)
    return np.where(has_material[:, None], model.mat_rgba[model.geom_matid], worn)[:, :3]


def _of_props(scene: SceneView) -> NDArray[np.bool_]:
    """(ngeom,) geoms of neither room nor arms."""
    bodies = scene.model.geom_bodyid
    return (scene.model.body_rootid[bodies] != 0) & (scene.arm_of_body[bodies] < 0)


register(Axis(**data("object_colour"), look=_recolour_props))


def _clouds(rows: NDArray, columns: NDArray) -> NDArray:
    coarse, fine = (noise(cells, (len(rows), len(rows)), (cells, cells)) for cells in (4, 16))
    return np.clip(1.4 * (0.7 * coarse + 0.3 * fine) - 0.2, 0, 1)


PATTERNS: Mapping[str, Pattern] = {
    "checks": lambda rows, columns: (np.floor(4 * rows) + np.floor(4 * columns)) % 2,
    "stripes": lambda rows, columns: np.sin(8 * np.pi * (rows + columns)) > 0,
    "dots": lambda rows, columns: np.hypot((4 * rows) % 1 - 0.5, (4 * columns) % 1 - 0.5) < 0.3,
    "clouds": _clouds,
}


@functools.cache  # every task has the same
def _paint(pattern: str, contrast: float) -> NDArray[np.uint8]:
    """A grey image (side, side, 3) of a pattern, coloured by the geom that wears it; dark places are grey by `contrast`."""
    rows, columns = np.mgrid[0:SIDE_PIXELS, 0:SIDE_PIXELS] / SIDE_PIXELS
    light = 1 - contrast * PATTERNS[pattern](rows, columns).astype(float)
    return to_image(np.repeat(light[..., None], 3, axis=-1))


def _add_patterns(model: mujoco.MjSpec, magnitude: float) -> None:
    """Add every pattern for every surface; an episode draws which are worn."""
    for surface, (_, repeat) in SURFACES.items():
        for pattern in PATTERNS:
            add_material(model, f"{surface}_{pattern}", _paint(pattern, magnitude), repeat)


def _cover_surfaces(start: Start, appearance: Appearance) -> Appearance:
    """Draw a pattern and a colour for each surface."""
    model = start.scene.model
    materials = appearance.fields.get("geom_matid", model.geom_matid).copy()
    colours = appearance.fields.get("geom_rgba", model.geom_rgba).copy()
    for surface, (own, _) in SURFACES.items():
        pattern, drawn = start.rng.choice(list(PATTERNS)), start.rng.uniform(MIN_CHANNEL, 1, size=3)
        geoms = model.geom_matid == model.material(surface).id
        materials[geoms] = model.material(f"{surface}_{pattern}").id
        colours[geoms, :3] = own + TINT * start.magnitude * (drawn - own)
    return appearance.with_fields(geom_matid=materials, geom_rgba=colours)


register(Axis(**data("surfaces"), build=_add_patterns, look=_cover_surfaces))


@functools.cache
def paraphrases() -> Mapping[str, Templates]:
    """Task -> its other sentences, from `instruction.toml` beside this file; a task may have none."""
    return tomllib.loads(Path(__file__).with_name("instruction.toml").read_text(encoding="utf-8"))


def _has_paraphrases(task: TaskSpec, model: mujoco.MjSpec) -> bool:
    return task.name in paraphrases()


def _paraphrase(start: Start) -> None:
    """Draw one of the level's sentences."""
    _say_one(start, paraphrases()[start.task.spec.name][str(int(start.magnitude))])


def _vary_sentences(start: Start) -> None:
    """Draw one of the first sentences: the task's own, then those for training."""
    spec = start.task.spec
    templates = (*spec.instructions, *paraphrases()[spec.name]["training"])
    _say_one(start, templates[: int(start.magnitude)])


def _say_one(start: Start, templates: Sequence[str]) -> None:
    template = templates[int(start.rng.integers(len(templates)))]
    start.progress.instruction = template.format(**start.progress.variation.words)


register(Axis(**data("instruction"), applies_to=_has_paraphrases, begin=_paraphrase))
register(Axis(**data("sentences"), applies_to=_has_paraphrases, begin=_vary_sentences))

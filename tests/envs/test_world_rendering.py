"""What cameras see of the world, and where it is drawn."""

import hashlib
import math
import os
import re
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from types import SimpleNamespace

import numpy as np
import pytest

from lerobot_bimanual.arms import Arm
from lerobot_bimanual.cameras import CAMERA_NAMES
from lerobot_bimanual.geometry.pinhole import unproject
from lerobot_bimanual.geometry.pose import Pose
from lerobot_env_bimanual import gl
from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.episode.observations import calibration
from lerobot_env_bimanual.gl import MissingGL, mujoco
from lerobot_env_bimanual.props.ball import Ball
from lerobot_env_bimanual.props.block import Block
from lerobot_env_bimanual.rendering.film import zoomed_camera_fields
from lerobot_env_bimanual.robots.panda_looks import COARSE, FINE
from lerobot_env_bimanual.world.appearance import applied
from lerobot_env_bimanual.world.offscreen import Offscreen, Pixels
from lerobot_env_bimanual.world.rendering import Renderer
from lerobot_env_bimanual.world.scene import Scene
from lerobot_env_bimanual.world.textures import boards, plaster

SIZE = 128
SETTLE_AND_RENDER = (
    "from lerobot_env_bimanual.world.scene import Scene; from lerobot_env_bimanual.world.rendering import Renderer;"
    "scene = Scene(); scene.settle(1); print('physics runs'); Renderer(scene).render()"
)
FIXED = ("front", "left_shoulder", "right_shoulder")


def make_scene() -> Scene:
    scene = Scene([Block(), Ball()])
    scene.place("item", Pose.upright((0.10, 0.20, 0.79)))
    scene.place("ball", Pose.upright((0.35, -0.20, 0.90)))
    scene.settle(2)
    return scene


@pytest.fixture(scope="module")
def scene() -> Scene:
    return make_scene()


@pytest.fixture(scope="module")
def images(scene):
    with Renderer(scene, height=SIZE, width=SIZE) as renderer:
        return renderer.render()


def cameras_of(scene: Scene, height: int = SIZE, width: int = SIZE):
    extrinsics, intrinsics = calibration(scene, height, width)
    matrices = (extrinsics.reshape(5, 4, 4), intrinsics.reshape(5, 3, 3))
    return tuple(dict(zip(CAMERA_NAMES, of_all, strict=True)) for of_all in matrices)


def without_gl(program: str, **variables: str) -> subprocess.CompletedProcess[str]:
    env = {key: value for key, value in os.environ.items() if key not in ("MUJOCO_GL", "LP_NUM_THREADS")}
    command = (sys.executable, "-c", program)
    return subprocess.run(command, capture_output=True, text=True, env=env | variables)


def test_arrays_are_never_reused(scene):
    with Renderer(scene, ("front",), 64, 64) as renderer:
        first = renderer.render()["front"]
        copies = [array.copy() for array in first]
        scene.set_color("item", (0, 1, 0, 1))
        second = renderer.render()["front"]
        scene.set_color("item", (1, 0, 0, 1))
    for array, copy, later in zip(first, copies, second, strict=True):
        assert np.array_equal(array, copy)
        assert not np.shares_memory(array, later)
    assert not np.array_equal(first[0], second[0])


@pytest.mark.parametrize("camera", CAMERA_NAMES)
def test_depth_equals_rays_cast_through_the_pixel_centres(scene, images, camera):
    extrinsics, intrinsics = cameras_of(scene)
    points = unproject(images[camera][1], intrinsics[camera], extrinsics[camera])
    origin = extrinsics[camera][:3, 3].astype(np.float64)
    rng = np.random.default_rng(0)
    drawn = mujoco.MjvOption().geomgroup.copy()
    drawn[[COARSE, FINE]] = True, False  # in images of this size
    errors = []
    for row, column in rng.integers(0, SIZE, (60, 2)):
        ray = points[row, column] - origin
        length = np.linalg.norm(ray)
        geom = np.zeros(1, np.int32)
        hit = mujoco.mj_ray(scene.model, scene.data, origin, ray / length, drawn, 1, -1, geom)
        if hit > 0:
            errors.append(abs(hit - length))
    assert len(errors) > 20
    assert np.quantile(errors, 0.85) < 2e-4
    assert max(errors) < 0.02  # at silhouettes of round shapes, which are drawn with facets


@pytest.mark.parametrize("camera", FIXED)
def test_a_film_camera_zooms_in_and_keeps_moving_props_in_view(camera):
    scene, states = make_scene(), []
    for x_m in (0.1, 0.3):
        scene.reset()
        scene.place("item", Pose.upright((x_m, 0.05, 0.80)))
        scene.pose_arms(np.tile([0.0, 0.4, 0.0, -2.0, 0.0, 2.4, 0.8], (2, 1)))  # hands above the table
        states.append(scene.save_state())
    height, width = 480, 640
    view, index = zoomed_camera_fields(scene, camera, states, (height, width)), scene.model.camera(camera).id
    assert view["cam_fovy"][index] < 0.9 * scene.model.cam_fovy[index]
    with applied(scene.model, scene.data, view):
        axes, eye = scene.data.cam_xmat[index].reshape(3, 3).copy(), scene.data.cam_xpos[index].copy()
    half = math.tan(np.deg2rad(view["cam_fovy"][index]) / 2)
    for state in states:
        scene.restore_state(state)
        right, up, back = (scene.pose("item").position - eye) @ axes
        assert abs(up / back) < half
        assert abs(right / back) < half * width / height


def test_extrinsics_of_a_wrist_camera_move_with_the_hand():
    scene = make_scene()
    camera_in_hand = []
    for _ in range(2):
        extrinsics, _ = cameras_of(scene)
        camera_in_hand.append(scene.tcp(Arm.LEFT).inverse().matrix @ extrinsics["left_wrist"])
        action = scene.commanded
        action[0] += 0.2
        for _ in range(4):
            scene.tick(action)
    assert camera_in_hand[0] == pytest.approx(camera_in_hand[1], abs=1e-5)
    moved, _ = cameras_of(scene)
    assert np.linalg.norm(moved["left_wrist"][:3, 3] - extrinsics["left_wrist"][:3, 3]) > 0.05
    assert moved["front"] == pytest.approx(extrinsics["front"])


@pytest.mark.parametrize("cameras", [("right_wrist",), ("right_wrist", "front"), CAMERA_NAMES[::-1]])
def test_an_image_does_not_depend_on_which_other_cameras_are_rendered(scene, images, cameras):
    with Renderer(scene, cameras, SIZE, SIZE) as renderer:
        for camera, (rgb, depth) in renderer.render().items():
            assert np.array_equal(rgb, images[camera][0])
            assert np.array_equal(depth, images[camera][1])


def test_high_quality_has_shadows(scene, images):
    with Renderer(scene, ("front",), SIZE, SIZE, "high") as renderer:
        fine = renderer.render()["front"][0].astype(float)
    darker = np.mean(fine.mean(axis=-1) < images["front"][0].astype(float).mean(axis=-1) - 30)
    assert darker > 0.01


def test_edges_are_soft_in_colours_and_hard_in_depth(scene):
    renderers = (Renderer(scene, height=side, width=side) for side in (SIZE // 2, 3 * SIZE // 2))
    images, large = (renderer.render() for renderer in renderers)
    for camera, (rgb, depth_m) in images.items():
        large_rgb, large_depth_m = large[camera]
        # Depth is that at the centre of a pixel and is not averaged.
        assert np.mean(np.isclose(depth_m, large_depth_m[1::3, 1::3], rtol=1e-4)) > 0.99
        means = large_rgb.reshape(SIZE // 2, 3, SIZE // 2, 3, 3).mean(axis=(1, 3))
        soft_rms, hard_rms = (np.sqrt(np.mean((one - means) ** 2)) for one in (rgb, large_rgb[1::3, 1::3]))
        assert soft_rms < 0.75 * hard_rms


@pytest.mark.parametrize(
    ("variables", "cause"),
    [
        ({"MUJOCO_GL": "osmesa"}, "MUJOCO_GL is 'osmesa', which draws nothing here; set MUJOCO_GL=egl"),
        ({"MUJOCO_EGL_DEVICE_ID": "99"}, r"MUJOCO_EGL_DEVICE_ID .*, got 99\.$"),
        ({"PYOPENGL_PLATFORM": "glx"}, "PYOPENGL_PLATFORM"),
    ],
)
def test_without_a_context_physics_runs_and_rendering_names_the_cause(variables, cause):
    result = without_gl(SETTLE_AND_RENDER, **variables)
    assert "physics runs" in result.stdout
    problem = result.stderr.splitlines()[-1]
    assert re.search(f"{MissingGL.__name__}: no offscreen OpenGL context: .*{cause}", problem)
    assert "apt-get" not in problem


def test_physics_runs_where_egl_is_installed_but_no_library_of_opengl():
    loader = "import OpenGL.platform.ctypesloader as l; load = l.loadLibrary;"
    absent = "l.loadLibrary = lambda dll, name, *_, **__: load(dll, name if name == 'EGL' else 'absent');"
    result = without_gl(loader + absent + SETTLE_AND_RENDER, MUJOCO_GL="egl")
    assert "physics runs" in result.stdout
    assert MissingGL.__name__ in result.stderr.splitlines()[-1]


def test_mujoco_that_was_imported_before_with_another_backend_is_named():
    result = without_gl(f"import mujoco; {SETTLE_AND_RENDER}", MUJOCO_GL="")
    assert "physics runs" in result.stdout
    assert "mujoco was imported before with another backend; import it later" in result.stderr


@pytest.mark.parametrize(
    ("variables", "devices"),
    [
        ({}, ["0", None]),
        ({"LOCAL_RANK": "1"}, ["1", None]),
        ({"SLURM_LOCALID": "2"}, ["2", None]),
        ({"SLURM_LOCALID": "4"}, ["0", None]),
        ({"LOCAL_RANK": "3"}, ["0", None]),  # the last GPU is another job's, the next is taken
        ({"LOCAL_RANK": "1", "CUDA_VISIBLE_DEVICES": "0,2"}, ["2", None]),
        ({"LOCAL_RANK": "1", "MUJOCO_EGL_DEVICE_ID": "0"}, ["0", "0"]),
    ],
)
def test_ranks_draw_on_gpus_of_their_own_unless_the_user_chose_one(variables, devices, monkeypatch):
    for name in ("LOCAL_RANK", "SLURM_LOCALID", "CUDA_VISIBLE_DEVICES", gl.DEVICE):
        monkeypatch.delenv(name, raising=False)
    for name, value in variables.items():
        monkeypatch.setenv(name, value)
    egl = SimpleNamespace(eglQueryDevicesEXT=lambda: [*4 * ["GPU"], "software"], EGL_NO_DISPLAY=0)
    display = SimpleNamespace(EGL=egl, EGL_DISPLAY=None)
    display.create_initialized_egl_device_display = lambda: int(os.environ[gl.DEVICE] != "3")
    monkeypatch.setitem(sys.modules, "mujoco.egl", display)
    monkeypatch.setattr(gl, "_is_software", lambda device: device == "software")
    with gl.choose_gpu():
        chosen = os.environ[gl.DEVICE]
    assert [chosen, os.environ.get(gl.DEVICE)] == devices


def test_the_backend_is_chosen_before_mujoco_is_imported_and_a_choice_is_respected():
    program = "import os, lerobot_env_bimanual.gl; print(*map(os.getenv, ('MUJOCO_GL', 'LP_NUM_THREADS')))"
    assert without_gl(program).stdout.split() == ["egl", "0"]
    chosen = without_gl(program, MUJOCO_GL="disable", LP_NUM_THREADS="2")
    assert chosen.stdout.split() == ["disable", "2"]


def test_a_renderer_may_be_used_in_one_thread_and_closed_in_another(scene):
    renderer = Renderer(scene, ("front",), 24, 32)
    with ThreadPoolExecutor(1) as pool:
        there = pool.submit(renderer.render).result()["front"]
        here = renderer.render()["front"]
        pool.submit(renderer.close).result()
        again = pool.submit(renderer.render).result()["front"]
    renderer.close()
    for images in (here, again):
        assert all(np.array_equal(a, b) for a, b in zip(there, images, strict=True))


def test_an_environment_that_is_freed_while_another_draws_does_not_disturb_it(scene, images, monkeypatch):
    def collect_and_draw(offscreen: Offscreen, *arguments) -> Pixels:
        forgotten.clear()
        return draw(offscreen, *arguments)

    forgotten, draw = [Renderer(make_scene(), ("front",), 24, 32)], Offscreen.draw
    forgotten[0].render()
    monkeypatch.setattr(Offscreen, "draw", collect_and_draw)
    with Renderer(scene, height=SIZE, width=SIZE) as renderer:
        for camera, found in renderer.render().items():
            assert all(np.array_equal(a, b) for a, b in zip(found, images[camera], strict=True))
    assert not forgotten


def test_environments_play_and_render_in_several_threads_at_once():
    def play(seed: int) -> list[np.ndarray]:
        env = BimanualEnv("lift_ball", image_size=24, cameras="front")
        images = [env.reset(seed=seed)[0]["pixels"]["front"]]
        for _ in range(5):
            images += [env.step(env.scene.commanded)[0]["pixels"]["front"], env.render()]
        env.close()
        return images

    with ThreadPoolExecutor(2) as pool:
        at_once = list(pool.map(play, (0, 1)))
    for seed, images in enumerate(at_once):
        assert all(np.array_equal(a, b) for a, b in zip(images, play(seed), strict=True))


def test_textures_are_the_same_pixels_on_every_machine():
    wood = boards((0.8, 0.7, 0.6), (40, 64), count=4, joints=2, seed=5)
    wall = plaster((0.6, 0.7, 0.7), (32, 48), skirting=3, seed=5)
    assert (wood.dtype, wood.shape, wall.shape) == (np.uint8, (40, 64, 3), (32, 48, 3))
    assert hashlib.sha256(wood.tobytes() + wall.tobytes()).hexdigest()[:16] == "89b0316a1eb822ac"

"""What cameras see of the world, and where it is drawn."""

import hashlib
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
from lerobot_bimanual.geometry.pinhole import project, unproject
from lerobot_bimanual.geometry.pose import Pose
from lerobot_env_bimanual import gl
from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.gl import MissingGL, mujoco
from lerobot_env_bimanual.props.ball import Ball
from lerobot_env_bimanual.props.block import Block
from lerobot_env_bimanual.world.cameras import calibration
from lerobot_env_bimanual.world.rendering import Renderer
from lerobot_env_bimanual.world.scene import Scene
from lerobot_env_bimanual.world.textures import boards, plaster

SIZE = 128
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
    return (
        dict(zip(CAMERA_NAMES, extrinsics.reshape(5, 4, 4), strict=True)),
        dict(zip(CAMERA_NAMES, intrinsics.reshape(5, 3, 3), strict=True)),
    )


def without_gl(program: str, **variables: str) -> subprocess.CompletedProcess[str]:
    env = {key: value for key, value in os.environ.items() if key not in ("MUJOCO_GL", "LP_NUM_THREADS")}
    return subprocess.run(
        (sys.executable, "-c", program), capture_output=True, text=True, env=env | variables
    )


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
    errors = []
    for row, column in rng.integers(0, SIZE, (60, 2)):
        ray = points[row, column] - origin
        length = np.linalg.norm(ray)
        hit = mujoco.mj_ray(scene.model, scene.data, origin, ray / length, None, 1, -1, np.zeros(1, np.int32))
        if hit > 0:
            errors.append(abs(hit - length))
    assert len(errors) > 20
    assert np.median(errors) < 2e-4  # silhouettes of faceted round shapes may differ more


def test_the_cameras_see_the_whole_placement_area_and_the_hands_at_home(scene):
    extrinsics, intrinsics = cameras_of(scene)
    axes = (np.linspace(-0.05, 0.55, 7), np.linspace(-0.45, 0.40, 9), np.linspace(0.76, 1.10, 5))
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    pads = [f"{arm}_pad{finger}" for arm in Arm for finger in (1, 2)]
    hands = [
        *(scene.data.geom(pad).xpos for pad in pads),
        *(scene.data.body(f"{arm}_hand").xpos for arm in Arm),
    ]
    inside = {}
    for camera in FIXED:
        at_home = project(hands, intrinsics[camera], extrinsics[camera])[:, :2]
        assert np.all((at_home > 0) & (at_home < SIZE))
        pixels = project(grid, intrinsics[camera], extrinsics[camera])
        inside[camera] = np.all((pixels[:, :2] > 0) & (pixels[:, :2] < SIZE), axis=1) & (pixels[:, 2] > 0)
        span = np.ptp(pixels[:, :2], axis=0) / SIZE
        assert np.all(span > 0.5), f"{camera} wastes its image: the area spans {span} of it"
    assert inside["front"].all()
    assert (inside["left_shoulder"] | inside["right_shoulder"]).all()


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


def test_high_quality_has_shadows_and_smooth_edges(scene, images):
    with Renderer(scene, ("front",), SIZE, SIZE, "high") as renderer:
        fine = renderer.render()["front"][0].astype(float)
    plain = images["front"][0].astype(float)
    darker = np.mean(fine.mean(axis=-1) < plain.mean(axis=-1) - 30)
    assert darker > 0.01
    assert len(np.unique(fine.reshape(-1, 3), axis=0)) > len(np.unique(plain.reshape(-1, 3), axis=0))


@pytest.mark.parametrize(
    ("variables", "cause"),
    [
        ({"MUJOCO_GL": "osmesa"}, "MUJOCO_GL is 'osmesa', which draws nothing here; set MUJOCO_GL=egl"),
        ({"MUJOCO_EGL_DEVICE_ID": "99"}, r"MUJOCO_EGL_DEVICE_ID .*, got 99\.$"),
        ({"PYOPENGL_PLATFORM": "glx"}, "PYOPENGL_PLATFORM"),
    ],
)
def test_without_a_context_physics_runs_and_rendering_names_the_cause(variables, cause):
    program = (
        "from lerobot_env_bimanual.world.scene import Scene; from lerobot_env_bimanual.world.rendering import Renderer;"
        "scene = Scene(); scene.settle(1); print('physics runs'); Renderer(scene).render()"
    )
    result = without_gl(program, **variables)
    assert "physics runs" in result.stdout
    problem = result.stderr.splitlines()[-1]
    assert re.search(f"{MissingGL.__name__}: no offscreen OpenGL context: .*{cause}", problem)
    assert "apt-get" not in problem


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
    display = SimpleNamespace(
        EGL=egl,
        EGL_DISPLAY=None,
        create_initialized_egl_device_display=lambda: int(os.environ[gl.DEVICE] != "3"),
    )
    monkeypatch.setitem(sys.modules, "mujoco.egl", display)
    monkeypatch.setattr(gl, "_is_software", lambda device: device == "software")
    with gl.device_chosen():
        chosen = os.environ[gl.DEVICE]
    assert [chosen, os.environ.get(gl.DEVICE)] == devices


def test_the_backend_is_chosen_before_mujoco_is_imported_and_a_choice_is_respected():
    program = (
        "import os, lerobot_env_bimanual.gl; print(os.environ['MUJOCO_GL'], os.environ['LP_NUM_THREADS'])"
    )
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


MAX_DISTANCE_M = 0.02


def distance_m(model, data, geom: int, points: np.ndarray) -> np.ndarray:
    """Of points (n, 3) from the surface of a capsule, cylinder or box; negative inside."""
    local = (points - data.geom_xpos[geom]) @ data.geom_xmat[geom].reshape(3, 3)
    size, kind = model.geom_size[geom], model.geom_type[geom]
    if kind == mujoco.mjtGeom.mjGEOM_CAPSULE:
        local[:, 2] -= np.clip(local[:, 2], -size[1], size[1])
        return np.linalg.norm(local, axis=1) - size[0]
    if kind == mujoco.mjtGeom.mjGEOM_CYLINDER:
        over = np.column_stack([np.hypot(local[:, 0], local[:, 1]), np.abs(local[:, 2])]) - size[:2]
    else:
        assert kind == mujoco.mjtGeom.mjGEOM_BOX
        over = np.abs(local) - size
    return np.minimum(over.max(axis=1), 0) + np.linalg.norm(np.maximum(over, 0), axis=1)


def test_an_arm_s_shells_stand_out_of_what_collides_by_two_centimetres_at_most(scene):
    model, data = scene.model, scene.data
    collides = model.geom_contype != 0
    shells = np.flatnonzero((model.geom_type == mujoco.mjtGeom.mjGEOM_MESH) & ~collides)
    assert len(shells) > 30
    for shell in shells:
        body = model.geom_bodyid[shell]
        mesh = model.geom_dataid[shell]
        first = model.mesh_vertadr[mesh]
        corners = model.mesh_vert[first : first + model.mesh_vertnum[mesh]]
        corners = data.geom_xpos[shell] + corners @ data.geom_xmat[shell].reshape(3, 3).T
        # At a joint the housing belongs to one link or the other.
        kin = np.flatnonzero((model.body_parentid == body) | (np.arange(model.nbody) == body))
        kin = np.append(kin, model.body_parentid[body])
        near = np.flatnonzero(collides & np.isin(model.geom_bodyid, kin[kin > 0]))
        away = np.min([distance_m(model, data, geom, corners) for geom in near], axis=0)
        assert away.max() < MAX_DISTANCE_M, f"{model.body(body).name} looks larger than it is"


def test_textures_are_the_same_pixels_on_every_machine():
    wood = boards((0.8, 0.7, 0.6), (40, 64), count=4, joints=2, seed=5)
    wall = plaster((0.6, 0.7, 0.7), (32, 48), skirting=3, seed=5)
    assert (wood.dtype, wood.shape, wall.shape) == (np.uint8, (40, 64, 3), (32, 48, 3))
    assert hashlib.sha256(wood.tobytes() + wall.tobytes()).hexdigest()[:16] == "89b0316a1eb822ac"

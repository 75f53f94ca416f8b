"""One Franka Emika Panda with its parallel hand, built from primitive shapes.

Kinematics are the modified Denavit-Hartenberg parameters of the Franka Control Interface documentation; masses, inertias and
collision shapes of the links are in `panda.toml`. Collision shapes are capsules, cylinders and boxes, so that checks are cheap.
They are not drawn: `panda_looks.py` has the visual ones.
"""

import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from lerobot_bimanual.geometry.pose import Pose
from lerobot_env_bimanual.gl import mujoco
from lerobot_env_bimanual.props.prop import COLLISION_ONLY, add_box, add_camera
from lerobot_env_bimanual.robots.panda_looks import DARK, add_looks

LINK_OFFSET_M = (0.333, 0.0, 0.316, 0.0, 0.384, 0.0, 0.0)
LINK_LENGTH_M = (0.0, 0.0, 0.0, 0.0825, -0.0825, 0.0, 0.088)
LINK_TWIST_RAD = tuple(np.pi / 2 * turns for turns in (0, -1, 1, 1, -1, 1, 1))
FLANGE_M = 0.107
HAND_YAW_RAD = -np.pi / 4
TCP_M = 0.1034
FINGER_MOUNT_M = 0.0584
FINGER_TRAVEL_M = 0.04
PALM_M = 0.0668

JOINT_LOWER = np.array([-2.8973, -1.7628, -2.8973, -3.0718, -2.8973, -0.0175, -2.8973])
JOINT_UPPER = np.array([2.8973, 1.7628, 2.8973, -0.0698, 2.8973, 3.7525, 2.8973])
# "Limits" of the Franka Control Interface documentation.
TORQUE_LIMIT_NM = (87.0, 87.0, 87.0, 87.0, 12.0, 12.0, 12.0)
VELOCITY_LIMIT_RAD_S = np.array([2.175, 2.175, 2.175, 2.175, 2.61, 2.61, 2.61])
ACCELERATION_LIMIT_RAD_S2 = np.array([15.0, 7.5, 10.0, 12.5, 15.0, 20.0, 20.0])
JERK_LIMIT_RAD_S3 = 500.0 * ACCELERATION_LIMIT_RAD_S2

# Position servos, half as stiff as Franka's own joint impedance (3000 to 2000 N m/rad), wrists less than a third, so that
# hands that press do not drive the wrists into their torque limits. Velocity and inertia are fed forward by the caller.
# How far hands end from their targets is in docs/tasks.md.
POSITION_GAIN = np.array([1500.0, 1500.0, 1500.0, 1200.0, 600.0, 600.0, 600.0])
VELOCITY_GAIN_RATIO_S = 0.05
JOINT_ARMATURE = 0.1
JOINT_DAMPING = 1.0

# The two fingers share one servo: 20 N per finger at zero width, 40 N, where its force ends, from 28 mm on. The real
# hand holds with up to 70 N; all thirteen tasks work with less.
GRIPPER_GAIN = 3000.0
GRIPPER_DAMPING = 80.0
GRIPPER_FORCE_LIMIT_N = 80.0
CLOSED_TRAVEL_M = -0.013
FINGER_SPEED_M_S = 0.1
FINGER_DAMPING = 5.0
STIFF_SOLREF = (0.004, 1)
STIFF_SOLIMP = (0.95, 0.99, 0.001, 0.5, 2)

_DATA = tomllib.loads(Path(__file__).with_suffix(".toml").read_text(encoding="utf-8"))
LINKS = _DATA["links"]
SHAPES = {"capsule": mujoco.mjtGeom.mjGEOM_CAPSULE, "cylinder": mujoco.mjtGeom.mjGEOM_CYLINDER}

# The base with its first link, and the hand with its flange, touch by design. All other pairs that can meet
# collide: a hand that is folded back (joint 6 below 0.4 rad) can run into its own forearm, link 5.
TOUCHING_BY_DESIGN = (("base", "link1"), ("link7", "hand"))
BODIES = ("base", *(f"link{number}" for number in range(1, 8)), "hand")
# Second neighbours never meet at any joint angles: flange and forearm stay 3 mm apart, the others 38 mm or
# more. Excluding them only makes collision checks faster.
NEVER_MEETING = tuple(zip(BODIES, BODIES[2:], strict=False))

WRIST_CAMERA_M = ((0.085, 0.0, 0.04), (0.0, 0.0, 0.18))
"""On the hand's side, and the point that it looks at: it sees both fingertips and what lies ahead of them."""
WRIST_CAMERA_FOVY_DEG = 75.0


def add_panda(spec: mujoco.MjSpec, prefix: str, base: Pose) -> None:
    """Write an arm into a model under construction, with hand, wrist camera and actuators: joints 1 to 7, then the gripper.

    Every name begins with the prefix, e.g. "left"; `base` is the world pose of the mounting face.
    """
    body = spec.worldbody.add_body(name=f"{prefix}_base", pos=base.position, quat=base.quat_wxyz)
    add_box(body, (-0.05, 0, 0.03), (0.09, 0.07, 0.03), **COLLISION_ONLY)
    _add_covers(body, _DATA["base"])
    add_looks(spec, body, "base")
    for index in range(7):
        body = _add_link(body, prefix, index)
        add_looks(spec, body, f"link{index + 1}")
        _add_servo(spec, prefix, index)
    hand = _add_hand(body, prefix)
    add_looks(spec, hand, "hand")
    for side, yaw in ((1, 0.0), (2, np.pi)):
        finger = _add_finger(hand, f"{prefix}_finger{side}", f"{prefix}_pad{side}", yaw)
        add_looks(spec, finger, "finger")
    add_camera(hand, f"{prefix}_wrist", *WRIST_CAMERA_M, WRIST_CAMERA_FOVY_DEG, up=(1, 0, 0))
    _add_gripper(spec, prefix)
    for first, second in TOUCHING_BY_DESIGN + NEVER_MEETING:
        spec.add_exclude(bodyname1=f"{prefix}_{first}", bodyname2=f"{prefix}_{second}")
    spec.add_exclude(bodyname1=f"{prefix}_finger1", bodyname2=f"{prefix}_finger2")


def _add_covers(body, link: Mapping[str, Any]) -> None:
    for cover in link["covers"]:
        size, ends = (cover["radius"], 0, 0), cover["ends"]
        body.add_geom(type=SHAPES[cover["shape"]], size=size, fromto=ends, **COLLISION_ONLY)


def _add_link(parent, prefix: str, index: int):
    length, offset, twist = LINK_LENGTH_M[index], LINK_OFFSET_M[index], LINK_TWIST_RAD[index]
    link = parent.add_body(
        name=f"{prefix}_link{index + 1}",
        pos=(length, -offset * np.sin(twist), offset * np.cos(twist)),
        quat=(np.cos(twist / 2), np.sin(twist / 2), 0, 0),
        gravcomp=1,
        mass=LINKS[index]["mass_kg"],
        ipos=LINKS[index]["centre_of_mass_m"],
        fullinertia=LINKS[index]["inertia"],
        explicitinertial=True,
    )
    link.add_joint(
        name=f"{prefix}_joint{index + 1}",
        type=mujoco.mjtJoint.mjJNT_HINGE,
        axis=(0, 0, 1),
        range=(JOINT_LOWER[index], JOINT_UPPER[index]),
        armature=JOINT_ARMATURE,
        damping=JOINT_DAMPING,
        # The motor carries the arm's weight; the torque that this takes is not available for motion.
        actgravcomp=True,
        actfrclimited=True,
        actfrcrange=(-TORQUE_LIMIT_NM[index], TORQUE_LIMIT_NM[index]),
    )
    _add_covers(link, LINKS[index])
    return link


def _add_servo(spec: mujoco.MjSpec, prefix: str, index: int) -> None:
    gain = POSITION_GAIN[index]
    servo = spec.add_actuator(
        name=f"{prefix}_actuator{index + 1}",
        target=f"{prefix}_joint{index + 1}",
        trntype=mujoco.mjtTrn.mjTRN_JOINT,
        ctrlrange=(JOINT_LOWER[index], JOINT_UPPER[index]),
    )
    servo.set_to_position(kp=gain, kv=VELOCITY_GAIN_RATIO_S * gain)


def _add_hand(link7, prefix: str):
    hand = link7.add_body(
        name=f"{prefix}_hand",
        pos=(0, 0, FLANGE_M),
        quat=(np.cos(HAND_YAW_RAD / 2), 0, 0, np.sin(HAND_YAW_RAD / 2)),
        gravcomp=1,
        mass=0.73,
        ipos=(-0.01, 0, 0.03),
        inertia=(0.001, 0.0025, 0.0017),
        explicitinertial=True,
    )
    add_box(hand, (0, 0, PALM_M / 2), (0.0316, 0.1025, PALM_M / 2), **COLLISION_ONLY)
    hand.add_site(name=f"{prefix}_tcp", pos=(0, 0, TCP_M), size=(0.004, 0, 0), rgba=(1, 0, 0, 0))
    return hand


def _add_finger(hand, name: str, pad: str, yaw: float):
    finger = hand.add_body(
        name=name,
        pos=(0, 0, FINGER_MOUNT_M),
        quat=(np.cos(yaw / 2), 0, 0, np.sin(yaw / 2)),
        gravcomp=1,
        mass=0.015,
        ipos=(0, 0.01, 0.02),
        inertia=(6e-6, 6e-6, 2e-6),
        explicitinertial=True,
    )
    finger.add_joint(
        name=name,
        type=mujoco.mjtJoint.mjJNT_SLIDE,
        axis=(0, 1, 0),
        range=(0, FINGER_TRAVEL_M),
        solref_limit=STIFF_SOLREF,
        solimp_limit=STIFF_SOLIMP,
        armature=JOINT_ARMATURE,
        damping=FINGER_DAMPING,
    )
    add_box(finger, (0, 0.0145, 0.011), (0.0105, 0.007, 0.011), **COLLISION_ONLY)
    add_box(finger, (0, 0.008, 0.031), (0.0085, 0.006, 0.016), **COLLISION_ONLY)
    # Hard, grippy rubber whose friction wins over whatever it touches.
    rubber = {"condim": 4, "friction": (1.5, 0.02, 0.0005), "priority": 1}
    hard = {"solref": STIFF_SOLREF, "solimp": STIFF_SOLIMP}
    add_box(finger, (0, 0.004, 0.0445), (0.0095, 0.004, 0.0105), name=pad, rgba=DARK, **rubber, **hard)
    return finger


def _add_gripper(spec: mujoco.MjSpec, prefix: str) -> None:
    """Couple the fingers and drive their mean travel with one servo."""
    coupling = spec.add_tendon(name=f"{prefix}_fingers")
    for finger in (1, 2):
        coupling.wrap_joint(f"{prefix}_finger{finger}", 0.5)
    spec.add_equality(
        name=f"{prefix}_fingers",
        type=mujoco.mjtEq.mjEQ_JOINT,
        objtype=mujoco.mjtObj.mjOBJ_JOINT,
        name1=f"{prefix}_finger1",
        name2=f"{prefix}_finger2",
        data=(0, 1, *(0,) * (mujoco.mjNEQDATA - 2)),  # one finger's travel equals the other's
        solref=(0.005, 1),
        solimp=STIFF_SOLIMP,
    )
    servo = spec.add_actuator(
        name=f"{prefix}_gripper",
        target=f"{prefix}_fingers",
        trntype=mujoco.mjtTrn.mjTRN_TENDON,
        ctrlrange=(CLOSED_TRAVEL_M, FINGER_TRAVEL_M),
        forcerange=(-GRIPPER_FORCE_LIMIT_N, GRIPPER_FORCE_LIMIT_N),
    )
    servo.set_to_position(kp=GRIPPER_GAIN, kv=GRIPPER_DAMPING)

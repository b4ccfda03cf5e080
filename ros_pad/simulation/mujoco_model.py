# SPDX-License-Identifier: Apache-2.0
"""The robot of fidelity level L2 as a MuJoCo model: trunk, legs, servos, towed load, ground.

Axes of the body: x fore, y left, z up. Links are rods from joint to joint.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from html import escape  # xml.sax would import all of urllib
from typing import Any

import numpy as np

from ros_pad.contact.meniscus import GRAVITY
from ros_pad.errors import ConfigError
from ros_pad.robots import Robot
from ros_pad.robots.rotation import Array, quaternion
from ros_pad.simulation.scene import Scene, Tow

ROLL_SHARE = 0.6  # inertia of the trunk about x, or about y, over that about z, assumed

# Radius of the ball that stands for the sole: too small to roll noticeably as the tibia tilts.
POINT = 1e-4  # m

LONGEST = 1e-3  # s

RESOLVED = 0.2
"""Longest step over the time 1/ω in which a foot swings on its domes. On wet ground the film under
them follows their load; with steps twice as long loads come a third more slowly."""

_SHORTEST = 1e-4  # s: loads in tow that need shorter steps are refused


@dataclass(frozen=True)
class SolverSettings:
    """Settings of MuJoCo for a step.

    Parameters
    ----------
    timestep : float or None
        Longest step, s, 1e-5 to 0.01; None for :data:`LONGEST`, or as short as feet that land on
        wet ground need. The actual step divides the robot's period, and is short enough for the
        oscillation of a towed load on its line.
    integrator : str
        ``Euler``, ``implicit`` or ``implicitfast``.
    cone : str
        ``pyramidal`` or ``elliptic``.
    impratio : float
        Stiffness of friction over that of the normal contact, 1 to 1e4. A foot at a share of its
        friction limit creeps at a speed proportional to 1/impratio; shorter steps do not help.
    """

    timestep: float | None = None
    integrator: str = 'implicitfast'
    cone: str = 'elliptic'
    impratio: float = 3000.0


RECOMMENDED = SolverSettings()
"""Settings with which feet creep at less than 0.1 mm/s at 0.8 of the friction limit. With longer
steps feet slip before the limit."""


def tow_step(scene: Scene) -> float:
    """Return the longest step of MuJoCo, s, for a scene's towed load; infinite without a load.

    MuJoCo integrates springs explicitly: without damping they are unstable from a step of 2/ω on,
    with ω the natural frequency of load and trunk on the line. Half of that is certainly stable.

    Raises
    ------
    ConfigError
        When the load is too light for so stiff a line.
    """
    tow = scene.tow
    if not tow.weight:
        return math.inf
    body, _ = scene.legged
    legs = sum(joint.mass for leg in body.robot.chains.legs for joint in leg)
    trunk = body.mass * (1.0 - legs / body.robot.mass)
    longest = 1.0 / math.sqrt(tow.stiffness * (GRAVITY / tow.weight + 1.0 / trunk))
    if longest < _SHORTEST:
        raise ConfigError(
            f'scene {scene.name!r}: tow.weight = {tow.weight:g} N on a line of tow.stiffness ='
            f' {tow.stiffness:g} N/m needs steps of at most {longest:.2g} s; the shortest allowed'
            f' are {_SHORTEST:g} s: increase tow.weight, set it to 0, or lower tow.stiffness'
        )
    return longest


def landing_step(scene: Scene, model: Any) -> float:
    """Return the longest step of MuJoCo, s, for feet that land.

    A flat foot must not bounce higher than it fell: it sinks for a step before it is pushed back.
    """
    feet = model.geom_bodyid[[model.geom(f'foot_{leg}').id for leg in scene.legs]]
    inverse, foot = model.body_invweight0[feet, 0].max(), scene.foot
    square = foot.sole_stiffness * inverse
    if scene.floor.kind != 'dry':
        square = max(square, foot.dome_stiffness * inverse / RESOLVED**2)
    return max(1.0 / math.sqrt(square), _SHORTEST)


def mjcf(scene: Scene, uneven: bool, settings: SolverSettings) -> str:
    """Return the robot, its towed load and the ground of each foot in MuJoCo's XML.

    Parameters
    ----------
    scene : Scene
        A scene with a legged robot.
    uneven : bool
        Whether the ground below each foot can move up and down.
    settings : SolverSettings
        Settings of MuJoCo, except the step.

    Raises
    ------
    ConfigError
        When the legs alone have more inertia than the scene's body.
    """
    (body, _), tow, slope = scene.legged, scene.tow, scene.floor.slope
    robot = body.robot
    grounds, trees, pairs, sensors = [], [], [], []
    for leg in scene.legs:
        ground = f'<geom name="block_{leg}" type="plane" size="0 0 1"/>'
        # Each body costs computing time, so a block is a body only if it can move.
        grounds.append(f'<body mocap="true">{ground}</body>' if uneven else ground)
        trees.append(_leg_xml(leg, robot, body.mass / robot.mass))
        pairs.append(
            f'<pair name="foot_{leg}" geom1="block_{leg}" geom2="foot_{leg}" condim="4"/>'
        )
        sensors.append(f'<contact geom1="block_{leg}" geom2="foot_{leg}" data="force torque"/>')
    defaults, motors = _drive_xml(robot)
    load = line = ''
    if tow.weight:
        grounds.append('<geom name="ground" type="plane" size="0 0 1"/>')
        load, line = _tow_xml(tow)
        pairs.append('<pair name="sled" geom1="ground" geom2="sled" condim="3"/>')
    return f"""
<mujoco>
  <compiler angle="radian" inertiafromgeom="false" balanceinertia="false"/>
  <option integrator="{settings.integrator}" cone="{settings.cone}"
          impratio="{settings.impratio!r}" tolerance="1e-6" jacobian="sparse"
          gravity="{-GRAVITY * math.sin(slope)!r} 0 {-GRAVITY * math.cos(slope)!r}">
    <flag autoreset="disable"/>
  </option>
  <default>
    <geom contype="0" conaffinity="0"/>
    {defaults}
  </default>
  <worldbody>
    {''.join(grounds)}
    <body name="trunk">
      <freejoint/>
      {_trunk_inertial(scene)}
      <site name="hook" pos="0 0 {tow.height + body.ground!r}"/>
      {''.join(trees)}
    </body>
    {load}
  </worldbody>
  <contact>{''.join(pairs)}</contact>
  {line}
  <actuator>{motors}</actuator>
  <sensor>{''.join(sensors)}</sensor>
</mujoco>
"""


def _drive_xml(robot: Robot) -> tuple[str, str]:
    """Return what joints and motors of a robot have in common, and its motors, in XML."""
    servo, defaults, motors = robot.servo, '', ''
    if servo:
        defaults = f'<joint damping="{servo.damping!r}"/><position kp="{servo.stiffness!r}"/>'
    for joint in (each for leg in robot.chains.legs for each in leg):
        most, kind = min(joint.torque, 1e9), 'position' if servo else 'motor'
        motors += f'<{kind} joint="{escape(joint.name)}" forcerange="{-most!r} {most!r}"/>'
    return defaults, motors


def _trunk_inertial(scene: Scene) -> str:
    """Return mass, place and inertia of the trunk in XML.

    The links are rods. The trunk has the rest of the mass, and place and inertia such that the
    whole robot has its centre, and the scene's height of the centre of mass and inertia.

    Raises
    ------
    ConfigError
        When the legs alone have more inertia than the scene's body.
    """
    body, _ = scene.legged
    robot, scale = body.robot, body.mass / body.robot.mass
    centre = np.array((*robot.centre, body.height + body.ground))
    legs, yaw, moment = 0.0, body.inertia, body.mass * centre
    frames = robot.chains.solve(robot.home).frames
    ends = np.concatenate([frames[1:, :, :3, 3], robot.foot_positions(robot.home)[None]])
    for leg, joints in enumerate(robot.chains.legs):
        for place, joint in enumerate(joints):
            frame, mass = frames[place, leg], scale * joint.mass
            middle = (frame @ np.append(joint.centre, 1.0))[:3]
            rod = (ends[place, leg] - frame[:3, 3])[:2]
            away = middle[:2] - centre[:2]
            yaw -= mass * float(away @ away + rod @ rod / 12.0)
            moment = moment - mass * middle
            legs += mass
    trunk = body.mass - legs
    at = moment / trunk
    yaw -= trunk * float(np.sum((at - centre)[:2] ** 2))
    if yaw <= 0.0:
        raise ConfigError(
            f'scene {scene.name!r}: body.inertia = {body.inertia:g} kg m2 is not allowed: more'
            f' than {body.inertia - yaw:.3g} kg m2 is needed, the inertia of the legs, which have'
            f' {legs / body.mass:.0%} of body.mass = {body.mass:g} kg'
        )
    roll = ROLL_SHARE * yaw
    return (
        f'<inertial mass="{trunk!r}" pos="{words(at)}"\n'
        f'                diaginertia="{roll!r} {roll!r} {yaw!r}"/>'
    )


def _leg_xml(leg: int, robot: Robot, scale: float) -> str:
    """Return links and foot of a leg in XML; ``scale`` is a factor on the masses."""
    joints, tip = robot.chains.legs[leg - 1], robot.chains.feet[leg - 1].copy()
    foot = tip[:3, 3].copy()
    text, ends = '', ''
    for place, joint in enumerate(joints):
        end = joints[place + 1].at[:3, 3] if place + 1 < len(joints) else foot
        kind = 'type="slide" ' if joint.slides else ''
        link = joint.name + '_link' * (joint.name in ('world', 'trunk', 'sled'))
        rotor = joint.rotor_inertia or 4e-3 * robot.mass * robot.height**2  # as of a Go2
        text += (
            f'<body name="{escape(link)}" {at_frame(joint.at)}>'
            f'<joint {kind}name="{escape(joint.name)}"'
            f' axis="{words(joint.axis)}" armature="{rotor!r}"/>'
            f'{_rod_xml(scale * joint.mass, joint.centre, end)}'
        )
        ends += '</body>'
    tip[2, 3] += POINT
    # The ball has the axes of the foot's link: forces are measured in them.
    return f'{text}<geom name="foot_{leg}" size="{POINT}" {at_frame(tip)}/>{ends}'


def _rod_xml(mass: float, centre: Array, end: Array) -> str:
    """Return a rod from a joint to the next one, m, with the centre of its mass, m."""
    length = math.sqrt(float(end @ end))
    mass, across = max(mass, 1e-6), max(mass * length * length / 12.0, 1e-9)
    # MuJoCo refuses a rod without inertia about its own axis.
    thin = 0.02 * across
    along = end / length if length > 0.0 else np.zeros(3)
    inertia = across * np.eye(3) - (across - thin) * along[:, None] * along
    if np.abs(inertia - np.diag(np.diag(inertia))).max() > 1e-15:
        full = inertia[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
        return f'<inertial mass="{mass!r}" pos="{words(centre)}" fullinertia="{words(full)}"/>'
    return (
        f'<inertial mass="{mass!r}" pos="{words(centre)}"'
        f' diaginertia="{words(np.diag(inertia))}"/>'
    )


def words(numbers: Array) -> str:
    """Return numbers as MuJoCo's XML has them."""
    return ' '.join(repr(float(each)) for each in numbers)


def at_frame(frame: Array) -> str:
    """Return place and rotation of a frame, (4, 4), as attributes of MuJoCo's XML."""
    turn = quaternion(frame[:3, :3])[[3, 0, 1, 2]]
    return f'pos="{words(frame[:3, 3])}" quat="{words(turn)}"'


def _tow_xml(tow: Tow) -> tuple[str, str]:
    """Return the towed load and its line in XML."""
    load = (
        f'<body name="sled" pos="0 0 {POINT}">'
        '<joint type="slide" axis="1 0 0" armature="0" damping="0"/>'
        '<joint type="slide" axis="0 1 0" armature="0" damping="0"/>'
        '<joint type="slide" axis="0 0 1" armature="0" damping="0"/>'
        f'<inertial mass="{tow.weight / GRAVITY!r}" pos="0 0 0" diaginertia="1 1 1"/>'
        f'<geom name="sled" size="{POINT}"/>'
        f'<site name="sled" pos="0 0 {tow.height - POINT!r}"/></body>'
    )
    line = (
        f'<tendon><spatial name="line" stiffness="{tow.stiffness!r}"'
        f' springlength="0 {tow.distance!r}">'
        '<site site="hook"/><site site="sled"/></spatial></tendon>'
    )
    return load, line

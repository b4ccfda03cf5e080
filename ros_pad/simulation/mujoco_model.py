# SPDX-License-Identifier: Apache-2.0
"""The hexapod of fidelity level L2 as a MuJoCo model: geometry of the legs, masses, servos, XML.

Axes of the body: x fore, y left, z up. Each leg turns about the vertical at its hip (coxa), then
about two level axes (femur, tibia). All joint angles are zero at home, where the femur is level
and the tibia upright, and positive counter-clockwise seen from above (coxa), up (femur) and
outwards (tibia).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from ros_pad.configuration import choice
from ros_pad.configuration import integer
from ros_pad.configuration import number
from ros_pad.contact.meniscus import GRAVITY
from ros_pad.errors import ConfigError
from ros_pad.errors import InvalidInput
from ros_pad.simulation.gait import TripodGait
from ros_pad.simulation.robot import Vector
from ros_pad.simulation.scene import HexapodBody
from ros_pad.simulation.scene import Scene
from ros_pad.simulation.scene import Tow

# Servos: HS-645MG at 6 V, the class that the CH3-R is built with.
STALL_TORQUE = 0.94  # N m
NO_LOAD_SPEED = 5.2  # rad/s: 60 degrees in 0.2 s
FULL_TORQUE_ERROR = 0.05  # rad from the set-point at which a servo gives its full torque, assumed
ROTOR_INERTIA = 2e-3  # kg m² of the motor behind its gears, assumed

# Shares of the robot's mass in each link of one leg, assumed; the rest is the trunk. The servo of
# each joint belongs to the link before it: the servo of the coxa to the trunk, that of the femur
# to the coxa, that of the tibia to the femur.
COXA_SHARE, FEMUR_SHARE, TIBIA_SHARE = 0.02, 0.015, 0.015
ROLL_SHARE = 0.6  # inertia of the trunk about x, or about y, over that about z, assumed

# Legs 1, 3, 4, 6 point 30 degrees off the fore-and-aft axis, 2 and 5 straight aside (CH3-R).
BEARINGS = tuple(math.radians(angle) for angle in (30.0, 90.0, 150.0, -150.0, -90.0, -30.0))
LINKS = ('coxa', 'femur', 'tibia')
TRAVEL = math.pi / 2.0  # rad to either side of home

# Radius of the ball that stands for the sole: too small to roll noticeably as the tibia tilts.
POINT = 1e-4  # m

_SHORTEST = 1e-4  # s: a towed load that needs shorter steps is refused


@dataclass(frozen=True)
class SolverSettings:
    """Settings of MuJoCo for a step.

    Parameters
    ----------
    timestep : float
        Longest step, s, 1e-5 to 0.01. The actual step divides the robot's period, and is short
        enough for the oscillation of a towed load on its line.
    integrator : str
        ``Euler``, ``implicit`` or ``implicitfast``.
    cone : str
        ``pyramidal`` or ``elliptic``.
    impratio : float
        Stiffness of friction over that of the normal contact, 1 to 1e4. A foot at a share of its
        friction limit creeps at a speed proportional to 1/impratio; shorter steps do not help.
    noslip_iterations : int
        Iterations of the solver that removes the creep afterwards, 0 to 100; for elliptic cones
        only.

    Raises
    ------
    InvalidInput
        When a value is outside its range.
    """

    timestep: float = 2e-3
    integrator: str = 'implicitfast'
    cone: str = 'elliptic'
    impratio: float = 100.0
    noslip_iterations: int = 0

    def __post_init__(self) -> None:
        number('timestep', self.timestep, 's', 1e-5, 0.01)
        choice('integrator', self.integrator, ('Euler', 'implicit', 'implicitfast'))
        choice('cone', self.cone, ('pyramidal', 'elliptic'))
        number('impratio', self.impratio, '(ratio)', 1.0, 1e4)
        integer('noslip_iterations', self.noslip_iterations, 0, 100)


RECOMMENDED = SolverSettings()
"""Settings with which feet creep at less than 0.1 mm/s at 0.8 of the friction limit. With longer
steps feet slip before the limit."""


@dataclass(frozen=True)
class LegGeometry:
    """Lengths of one leg, and its place on the body.

    Attributes
    ----------
    hip_x, hip_y : float
        Axis of the coxa in the body, fore and left, m.
    bearing : float
        Direction in which the leg points at home, rad, 0 for fore and π/2 for left.
    coxa, femur, tibia : float
        Lengths of the links, m.
    """

    hip_x: float
    hip_y: float
    bearing: float
    coxa: float
    femur: float
    tibia: float

    @classmethod
    def standing_at(
        cls, home: tuple[float, float], bearing: float, body: HexapodBody
    ) -> LegGeometry:
        """Return the leg with its foot at ``home``, m, when all its joint angles are zero."""
        out = body.coxa + body.femur
        return cls(
            home[0] - out * math.cos(bearing),
            home[1] - out * math.sin(bearing),
            bearing,
            body.coxa,
            body.femur,
            body.tibia,
        )

    def foot(self, coxa: float, femur: float, tibia: float) -> Vector:
        """Return the foot's position, fore, left and above the hip, m, for joint angles, rad."""
        out = self.coxa + self.femur * math.cos(femur) + self.tibia * math.sin(femur + tibia)
        up = self.femur * math.sin(femur) - self.tibia * math.cos(femur + tibia)
        direction = self.bearing + coxa
        x = self.hip_x + out * math.cos(direction)
        return x, self.hip_y + out * math.sin(direction), up

    def angles(self, x: float, y: float, z: float) -> Vector:
        """Return the joint angles, rad, for a position of the foot, m; inverse of :meth:`foot`.

        Of the two solutions, this is the one with the knee above the line from the axis of the
        femur to the foot.

        Raises
        ------
        InvalidInput
            When the position is too far or too close for the leg.
        """
        x -= self.hip_x
        y -= self.hip_y
        coxa = math.remainder(math.atan2(y, x) - self.bearing, math.tau)
        out = math.hypot(x, y) - self.coxa
        femur, tibia = self.femur, self.tibia
        bend = (out * out + z * z - femur * femur - tibia * tibia) / (2.0 * femur * tibia)
        if not -1.0 <= bend <= 1.0:
            raise InvalidInput(
                f'foot {math.hypot(out, z):.4g} m from the joint between coxa and femur is out of'
                f' reach: {abs(femur - tibia):.4g} to {femur + tibia:.4g} m is needed'
            )
        # In the axes of the femur the foot is at (femur + tibia sin t, -tibia cos t).
        side = tibia * math.sqrt(1.0 - bend * bend)
        lift = math.atan2(z, out) + math.atan2(side, femur + tibia * bend)
        return coxa, math.remainder(lift, math.tau), math.asin(bend)


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
    assert isinstance(scene.body, HexapodBody)
    trunk = scene.body.mass * (1.0 - 6.0 * (COXA_SHARE + FEMUR_SHARE + TIBIA_SHARE))
    longest = 1.0 / math.sqrt(tow.stiffness * (GRAVITY / tow.weight + 1.0 / trunk))
    if longest < _SHORTEST:
        raise ConfigError(
            f'scene {scene.name!r}: tow.weight = {tow.weight:g} N on a line of tow.stiffness ='
            f' {tow.stiffness:g} N/m needs steps of at most {longest:.2g} s; the shortest allowed'
            f' are {_SHORTEST:g} s: increase tow.weight, set it to 0, or lower tow.stiffness'
        )
    return longest


def legs_of(scene: Scene) -> list[LegGeometry]:
    """Return legs 1 to 6 of a scene's robot; raise `ConfigError` if they cannot walk its gait."""
    assert isinstance(scene.body, HexapodBody) and isinstance(scene.gait, TripodGait)
    body, gait = scene.body, scene.gait
    legs = []
    for index, (home, bearing) in enumerate(zip(body.homes, BEARINGS, strict=True), 1):
        leg = LegGeometry.standing_at(home, bearing, body)
        name = f'scene {scene.name!r}: leg {index} at home ({home[0]:g}, {home[1]:g}) m'
        if leg.hip_y * home[1] <= 0.0:
            raise ConfigError(
                f'{name}: its hip would not be on the same side of the body: with coxa ='
                f' {body.coxa:g} m and femur = {body.femur:g} m the home must be more than'
                f' {abs(home[1] - leg.hip_y):.4g} m to the side'
            )
        for step in range(-8, 9):
            height = gait.lift * math.cos(step * math.pi / 16.0) ** 2
            for up in (0.0, height):
                ahead = home[0] + gait.reach() * step / 8.0
                try:
                    angles = leg.angles(ahead, home[1], up - body.tibia)
                except InvalidInput as error:
                    raise ConfigError(
                        f'{name}: {error}; shorten gait.stride, lower gait.lift, or change the'
                        ' lengths of the links'
                    ) from error
                if max(map(abs, angles)) > TRAVEL:
                    raise ConfigError(
                        f'{name}: with its foot {ahead - home[0]:+.4g} m ahead of home and'
                        f' {up:g} m up, a joint must turn {max(map(abs, angles)):.2f} rad, at most'
                        f' {TRAVEL:.2f} is allowed: shorten gait.stride or lower gait.lift'
                    )
        legs.append(leg)
    return legs


def mjcf(
    scene: Scene, legs: Sequence[LegGeometry], uneven: bool, settings: SolverSettings, dt: float
) -> str:
    """Return the robot, its towed load and the ground of each foot in MuJoCo's XML.

    Parameters
    ----------
    scene : Scene
        A scene with a hexapod.
    legs : sequence of LegGeometry
        Legs 1 to 6.
    uneven : bool
        Whether the ground below each foot can move up and down.
    settings : SolverSettings
        Settings of MuJoCo, except the step.
    dt : float
        Step of MuJoCo, s.

    Raises
    ------
    ConfigError
        When the legs alone have more inertia than the scene's body.
    """
    body, tow, slope = scene.body, scene.tow, scene.floor.slope
    assert isinstance(body, HexapodBody)
    grounds, trees, pairs, servos, sensors = [], [], [], [], []
    for leg, geometry in enumerate(legs, 1):
        ground = f'<geom name="block_{leg}" type="plane" size="0 0 1"/>'
        # Each body costs computing time, so a block is a body only if it can move.
        grounds.append(f'<body mocap="true">{ground}</body>' if uneven else ground)
        trees.append(_leg_xml(leg, geometry, _link_masses(body)))
        pairs.append(
            f'<pair name="foot_{leg}" geom1="block_{leg}" geom2="foot_{leg}" condim="4"/>'
        )
        sensors.append(f'<contact geom1="block_{leg}" geom2="foot_{leg}" data="force torque"/>')
        servos += [f'<position joint="leg_{leg}_{joint}"/>' for joint in LINKS]
    load = line = ''
    if tow.weight:
        grounds.append('<geom name="ground" type="plane" size="0 0 1"/>')
        load, line = _tow_xml(tow)
        pairs.append('<pair name="sled" geom1="ground" geom2="sled" condim="3"/>')
    return f"""
<mujoco>
  <compiler angle="radian" inertiafromgeom="false" balanceinertia="false"/>
  <option timestep="{dt!r}" integrator="{settings.integrator}" cone="{settings.cone}"
          impratio="{settings.impratio!r}" tolerance="1e-6" jacobian="sparse"
          noslip_iterations="{settings.noslip_iterations}"
          gravity="{-GRAVITY * math.sin(slope)!r} 0 {-GRAVITY * math.cos(slope)!r}">
    <flag autoreset="disable"/>
  </option>
  <default>
    <geom contype="0" conaffinity="0"/>
    <joint damping="{STALL_TORQUE / NO_LOAD_SPEED!r}" armature="{ROTOR_INERTIA!r}"/>
    <position kp="{STALL_TORQUE / FULL_TORQUE_ERROR!r}"
              forcerange="{-STALL_TORQUE!r} {STALL_TORQUE!r}"/>
  </default>
  <worldbody>
    {''.join(grounds)}
    <body name="trunk">
      <freejoint/>
      {_trunk_inertial(scene, legs)}
      <site name="hook" pos="0 0 {tow.height - body.tibia!r}"/>
      {''.join(trees)}
    </body>
    {load}
  </worldbody>
  <contact>{''.join(pairs)}</contact>
  {line}
  <actuator>{''.join(servos)}</actuator>
  <sensor>{''.join(sensors)}</sensor>
</mujoco>
"""


def _link_masses(body: HexapodBody) -> list[float]:
    """Return the masses of coxa, femur and tibia, kg."""
    return [share * body.mass for share in (COXA_SHARE, FEMUR_SHARE, TIBIA_SHARE)]


def _trunk_inertial(scene: Scene, legs: Sequence[LegGeometry]) -> str:
    """Return mass, place and inertia of the trunk in XML.

    The links are rods. The trunk has the rest of the mass, and place and inertia such that the
    whole robot has the scene's height of the centre of mass and inertia.

    Raises
    ------
    ConfigError
        When the legs alone have more inertia than the scene's body.
    """
    body = scene.body
    assert isinstance(body, HexapodBody)
    masses, tibia = _link_masses(body), body.tibia
    trunk = body.mass - 6.0 * sum(masses)
    sunk = (body.mass * body.height - 6.0 * tibia * (sum(masses) - masses[2] / 3.0)) / trunk
    yaw = body.inertia
    for leg, home in zip(legs, body.homes, strict=True):
        # Coxa and femur are in one line at home, the tibia is upright below its end.
        for mass, out, length in (
            (masses[0], 0.5 * leg.coxa, leg.coxa),
            (masses[1], leg.coxa + 0.5 * leg.femur, leg.femur),
        ):
            x = leg.hip_x + out * math.cos(leg.bearing)
            y = leg.hip_y + out * math.sin(leg.bearing)
            yaw -= mass * (x * x + y * y + length * length / 12.0)
        yaw -= masses[2] * (home[0] ** 2 + home[1] ** 2)
    if yaw <= 0.0:
        raise ConfigError(
            f'scene {scene.name!r}: body.inertia = {body.inertia:g} kg m2 is not allowed: more'
            f' than {body.inertia - yaw:.3g} kg m2 is needed, the inertia of the legs, which have'
            f' {6.0 * sum(masses) / body.mass:.0%} of body.mass = {body.mass:g} kg'
        )
    roll = ROLL_SHARE * yaw
    return (
        f'<inertial mass="{trunk!r}" pos="0 0 {sunk - tibia!r}"\n'
        f'                diaginertia="{roll!r} {roll!r} {yaw!r}"/>'
    )


def _leg_xml(leg: int, geometry: LegGeometry, masses: Sequence[float]) -> str:
    """Return coxa, femur, tibia and foot of a leg in XML."""
    coxa, femur, tibia = geometry.coxa, geometry.femur, geometry.tibia

    def link(name: str, at: str, axis: str, mass: float, middle: str, inertia: str) -> str:
        name = f'leg_{leg}_{name}'
        return (
            f'<body name="{name}" {at}><joint name="{name}" axis="{axis}"/>'
            f'<inertial mass="{mass!r}" pos="{middle}" diaginertia="{inertia}"/>'
        )

    def rod(mass: float, length: float, along: int) -> str:
        # MuJoCo refuses a rod without inertia about its own axis.
        across = mass * length * length / 12.0
        return ' '.join(repr(0.02 * across if axis == along else across) for axis in range(3))

    hip = f'pos="{geometry.hip_x!r} {geometry.hip_y!r} 0" euler="0 0 {geometry.bearing!r}"'
    return (
        link('coxa', hip, '0 0 1', masses[0], f'{coxa / 2.0!r} 0 0', rod(masses[0], coxa, 0))
        + link('femur', f'pos="{coxa!r} 0 0"', '0 -1 0', masses[1],
               f'{femur / 2.0!r} 0 0', rod(masses[1], femur, 0))
        + link('tibia', f'pos="{femur!r} 0 0"', '0 -1 0', masses[2],
               f'0 0 {-tibia / 3.0!r}', rod(masses[2], tibia, 2))
        + f'<geom name="foot_{leg}" size="{POINT}" pos="0 0 {POINT - tibia!r}"/>'
        '</body></body></body>'
    )  # fmt: skip


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

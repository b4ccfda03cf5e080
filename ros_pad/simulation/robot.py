# SPDX-License-Identifier: Apache-2.0
"""The interface of a simulated robot, the same on all fidelity levels."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np

from ros_pad.contact.meniscus import GRAVITY
from ros_pad.errors import ConfigError, InvalidInput
from ros_pad.records import Array
from ros_pad.robots.inverse import FeetSolver
from ros_pad.simulation.balance_step import USUAL_GRIP
from ros_pad.simulation.scene import Scene

Vector = tuple[float, float, float]


class Proprioception(NamedTuple):
    """What the sensors on a robot with joints measure, without noise.

    Attributes
    ----------
    gyro, accelerometer : array (3,)
        Angular velocity, rad/s, and specific force, m/s² (+9.81 upwards at rest), IMU axes.
    positions, velocities, efforts : array (joints,)
        Of the joints, in the order of ``joint_names``: rad, rad/s, and the torques of the motors
        behind their gears, N m.
    forces : array (feet, 3)
        Force of the ground on each foot, N, in the axes of the link that carries the foot.
    """

    gyro: Array
    accelerometer: Array
    positions: Array
    velocities: Array
    efforts: Array
    forces: Array


@dataclass(slots=True)
class FootState:
    """The true state of one foot after a step, in world axes and SI units.

    Attributes
    ----------
    position : tuple of float
        Position of the marker on the foot, above its soft pads, m.
    force : tuple of float
        Force of the ground on the foot, N; z up out of the floor.
    moment : float
        Yaw moment of the ground on the foot, N m.
    standing : bool
        Whether the foot carries load.
    wet : bool
        Whether the ground below the foot is wet; on L0 and L1, in swing, the value of the last
        stance.
    grip : float
        Present tangential capacity of the foot, N.
    slip_speed : float
        Speed of the foot's contact over the floor, m/s, from 0.
    slip_path : float
        Distance that the contact has slipped under load since the start, m.
    overload_time : float
        Time for which the load was above the force limit of the domes, s.
    """

    position: Vector = (0.0, 0.0, 0.0)
    force: Vector = (0.0, 0.0, 0.0)
    moment: float = 0.0
    standing: bool = False
    wet: bool = False
    grip: float = 0.0
    slip_speed: float = 0.0
    slip_path: float = 0.0
    overload_time: float = 0.0


class SimulatedRobot(Protocol):
    """A simulated robot: step it with the pads' gauge pressures, then read its feet and body.

    Attributes
    ----------
    legs : tuple of int
        Numbers of the legs.
    period : float
        Length of a step, s.
    time : float
        Simulated time, s.
    verdict : str or None
        Why the walk is no longer valid, for instance a tip-over; None while it is valid.
    joint_names : tuple of str
        Names of the robot's joints; empty on fidelity levels without joints.
    """

    legs: tuple[int, ...]
    period: float
    time: float
    verdict: str | None
    joint_names: tuple[str, ...]

    def step(self, pressures: Sequence[float]) -> None:
        """Advance by ``period`` with these gauge pressures, Pa, one for each leg.

        A pad at zero or below is flat. Above the foot's ceiling, domes have the same force limit
        as at the ceiling.

        Raises
        ------
        InvalidInput
            When there is not one finite pressure for each leg.
        """

    @property
    def feet(self) -> list[FootState]:
        """State of each foot, in the order of ``legs``; the objects stay the same."""

    @property
    def dissipation(self) -> float:
        """Work lost in feet that slip or turn, J."""

    @property
    def contacts(self) -> Array:
        """Force, N, yaw moment, N m, and position, m, of each foot, (feet, 7)."""

    @property
    def body(self) -> Vector:
        """Position x, y, m, and heading, rad, of the body in the world."""

    @property
    def joint_positions(self) -> tuple[float, ...]:
        """Angles of the joints, rad, in the order of ``joint_names``."""


def check_pressures(pressures: Sequence[float], legs: int) -> None:
    """Raise InvalidInput unless there is one finite gauge pressure, Pa, for each leg."""
    # If one value is not finite, the sum is not finite either.
    if len(pressures) != legs or not math.isfinite(sum(pressures)):
        raise InvalidInput(
            f'pressures = {pressures!r} Pa is not allowed: {legs} finite numbers are needed, one'
            ' for each leg'
        )


def check_reach(scene: Scene) -> FeetSolver:
    """Return the solver of the legs of a scene.

    Raises
    ------
    ConfigError
        When a foot does not reach the places to which lift, stride and steering of the gait bring
        it, or a joint would be beyond the travel of its servo or its limits.
    """
    body, gait = scene.legged
    wanted = {'lift': gait.lift, 'stride': gait.stride, 'heading_gain': scene.heading_gain}
    tried = dict.fromkeys(wanted, 0.0)
    for name, value in wanted.items():
        tried[name] = value
        if why := _miss(scene, **tried):
            low, high = 0.0, value
            while high - low > 0.01 * value:
                tried[name] = middle = 0.5 * (low + high)
                low, high = (low, middle) if _miss(scene, **tried) else (middle, high)
            unit = '1/s' if name == 'heading_gain' else 'm'
            raise ConfigError(
                f'{scene.source}: gait.{name} = {value:g} {unit} is not allowed: at most {low:.3g}'
                f' {unit} is within reach of the legs of {body.robot.source} from its home: {why}'
            )
    return FeetSolver(body.robot)


def check_strength(scene: Scene) -> None:
    """Raise `ConfigError` if legs or samples are not those of a robot that can keep its balance.

    The fewest legs that stand at once have to carry it.
    """
    body, gait = scene.legged
    robot, count = body.robot, body.robot.home.shape[1]
    if count < 3:
        raise ConfigError(
            f'{scene.source}: legs of {scene.robot} have {count} joints: at least 3 are needed to'
            ' keep the balance on L2: walk with --fidelity L1'
        )
    slowest = 16.0 * math.sqrt(GRAVITY / body.height)
    if scene.sensors.rate < slowest:
        raise ConfigError(
            f'{scene.source}: sensors.rate = {scene.sensors.rate:g} Hz is not allowed: at least'
            f' {slowest:.3g} Hz is needed to keep the balance on L2'
        )
    if sliding := [each.name for leg in robot.chains.legs for each in leg if each.slides]:
        raise ConfigError(
            f'{scene.source}: fidelity L2 is not for robots with joints that slide, as'
            f' {sliding[0]} of {scene.robot}: walk with --fidelity L1'
        )
    share = body.mass * GRAVITY / gait.fewest
    needed = share * np.abs(robot.kinematics(robot.home).jacobians[:, 2])
    for leg, torques in zip(robot.chains.legs, needed.tolist(), strict=True):
        for joint, torque in zip(leg, torques, strict=True):
            if torque > joint.torque:
                raise ConfigError(
                    f'{scene.source}: {joint.name} has {joint.torque:g} N m: at least'
                    f' {torque:.3g} N m is needed to stand on {gait.fewest} legs with'
                    f' {body.mass:g} kg; or let more legs stand (gait.duty)'
                )


def check_tow(scene: Scene) -> None:
    """Raise `ConfigError` if tow and slope need more than the grip of all feet on dry ground."""
    (body, gait), tow, slope = scene.legged, scene.tow, scene.floor.slope
    legs, weight = len(gait.middles), body.mass * GRAVITY
    foot = scene.foot.on_rough(scene.floor.roughness)
    load = weight * math.cos(slope)
    grip = min(legs * foot.grip(load / legs, 0.0), USUAL_GRIP * load)
    uphill = weight * math.sin(slope)
    each = tow.friction_dry * math.cos(slope) + math.sin(slope)  # N for each N of the tow
    if uphill + tow.weight * each > grip:
        raise ConfigError(
            f'{scene.source}: tow.weight = {tow.weight:g} N is not allowed: at most'
            f' {max(0.0, (grip - uphill) / max(each, 1e-9)):.3g} N can be pulled by all feet on'
            f' dry ground, at a slope of {slope:g} rad'
        )


def _miss(scene: Scene, lift: float, stride: float, heading_gain: float) -> str:
    """Return why the feet cannot follow the gait with these values, or an empty text."""
    body, gait = scene.legged
    robot, solver = body.robot, FeetSolver(body.robot)
    home, travel = robot.home.ravel(), robot.servo.travel if robot.servo else math.inf
    limits = np.array([joint.limits for leg in robot.chains.legs for joint in leg])
    lows = np.maximum(limits[:, 0], home - travel)
    highs = np.minimum(limits[:, 1], home + travel)
    reach = gait.reach() * stride / gait.stride
    # Legs must be able to steer back from a heading of 0.1 rad; this is the turn of a stance, rad.
    turn = 0.1 * heading_gain * gait.duty * gait.cycle
    for step in range(8, -9, -1):
        ahead, turned = reach * step / 8.0, turn * (8 - step) / 16.0
        up = lift * (1.0 - (step / 8.0) ** 2)
        for height, angle in {(h, a) for h in (0.0, up) for a in (turned, -turned)}:
            c, s = math.cos(angle), math.sin(angle)
            where = f'feet {ahead:+.3g} m ahead of home, {height:.3g} m up'
            where += f', body turned by {angle:.3g} rad' if angle else ''
            feet = [
                (c * (x + ahead) + s * y, c * y - s * (x + ahead), body.ground + height)
                for x, y in body.homes
            ]
            try:
                joints = np.array(solver.angles(feet))
            except InvalidInput as error:
                return f'{where}: {error}'
            if ((joints < lows - 1e-6) | (joints > highs + 1e-6)).any():
                worst = int(np.maximum(lows - joints, joints - highs).argmax())
                return (
                    f'{where}: {robot.joint_names[worst]} would be at {joints[worst]:.3g}, from'
                    f' {lows[worst]:.3g} to {highs[worst]:.3g} is allowed'
                )
    return ''

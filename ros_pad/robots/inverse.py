# SPDX-License-Identifier: Apache-2.0
"""Joint positions that bring the feet to given places, fast enough for every step of a walk."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from ros_pad.errors import InvalidInput
from ros_pad.robots.chains import Chains
from ros_pad.robots.chains import Joint
from ros_pad.robots.robot import Robot
from ros_pad.robots.rotation import Array
from ros_pad.robots.rotation import cross

Place = tuple[float, float, float]

_PARALLEL = 1e-9
_SHORTEST = 1e-6  # m, of a link
_ROUNDING = 1e-9


class LegSolver:
    """Joint positions of a leg with a hip and two parallel joints, in closed form.

    The axis of the hip may have any direction but that of the two others. Of up to four solutions,
    this takes the one in which hip and knee are bent as at home.

    Parameters
    ----------
    joints : sequence of Joint
        The joints of the leg, see :meth:`fits`.
    foot : array (4, 4)
        Transform from the last joint to the foot.
    home : sequence of float
        Joint positions at home, rad.
    """

    def __init__(self, joints: Sequence[Joint], foot: Array, home: Sequence[float]) -> None:
        hip, thigh, knee = joints
        self._home = home
        self._far = max(map(abs, home)) > 0.5 * math.pi
        turn = thigh.at[:3, :3] @ knee.at[:3, :3]
        across = thigh.at[:3, :3] @ thigh.axis  # axis of the thigh, in the link of the hip
        ahead = _normal_to(across)
        up = cross(across, ahead)
        self._base: list[list[float]] = hip.at[:3, :3].T.tolist()
        self._at: list[float] = hip.at[:3, 3].tolist()
        self._frame = [each.tolist() for each in (hip.axis, across, cross(hip.axis, across))]
        self._plane = [each.tolist() for each in (ahead, up, thigh.at[:3, 3])]
        upper = thigh.at[:3, :3] @ knee.at[:3, 3]
        lower = turn @ foot[:3, 3]
        self._side = float(across @ (thigh.at[:3, 3] + upper + lower))
        self._lean = float(hip.axis @ across)
        self._upper = (float(ahead @ upper), float(up @ upper))
        self._lengths = (
            math.hypot(*self._upper), math.hypot(float(ahead @ lower), float(up @ lower))
        )  # fmt: skip
        self._fold = math.atan2(float(up @ lower), float(ahead @ lower)) - math.atan2(
            self._upper[1], self._upper[0]
        )
        self._sense = 1.0 if float(turn @ knee.axis @ across) > 0.0 else -1.0
        bend = math.remainder(self._sense * home[2] + self._fold, math.tau)
        self._knee = 1.0 if bend >= 0.0 else -1.0
        place = Chains([joints], foot[None]).solve(np.array([home])).positions[0]
        middle = self._hip_turn(self._in_hip(*place.tolist()))[0]
        self._hip = 1.0 if math.remainder(home[0] - middle, math.tau) >= 0.0 else -1.0

    @staticmethod
    def fits(joints: Sequence[Joint], foot: Array) -> bool:
        """Return whether a leg has three joints that turn, the last two parallel and apart."""
        if len(joints) != 3 or any(joint.slides for joint in joints):
            return False
        hip, thigh, knee = joints
        across = thigh.at[:3, :3] @ thigh.axis
        last = thigh.at[:3, :3] @ knee.at[:3, :3] @ knee.axis
        parallel = np.abs(cross(across, last)).max() < _PARALLEL
        links = cross(thigh.axis, knee.at[:3, 3]), cross(knee.axis, foot[:3, 3])
        apart = min(np.abs(link).max() for link in links) > _SHORTEST
        return bool(parallel and apart and np.abs(cross(hip.axis, across)).max() > 1e-3)

    def _in_hip(self, x: float, y: float, z: float) -> list[float]:
        """Return a place of the base, m, in the axes of the hip."""
        at = self._at
        x, y, z = x - at[0], y - at[1], z - at[2]
        return [row[0] * x + row[1] * y + row[2] * z for row in self._base]

    def _hip_turn(self, p: Sequence[float]) -> tuple[float, float]:
        """Return middle and half of the difference of the two hip angles that fit, rad."""
        axis, across, ahead = self._frame
        along = axis[0] * p[0] + axis[1] * p[1] + axis[2] * p[2]
        near = across[0] * p[0] + across[1] * p[1] + across[2] * p[2] - self._lean * along
        far = ahead[0] * p[0] + ahead[1] * p[1] + ahead[2] * p[2]
        size, side = math.hypot(near, far), self._side - self._lean * along
        if abs(side) > size * (1.0 + _ROUNDING):
            raise InvalidInput(
                f'foot {size:.4g} m from the axis of the hip is out of reach: at least'
                f' {abs(side):.4g} m is needed'
            )
        return math.atan2(far, near), math.acos(max(-1.0, min(1.0, side / size if size else 1.0)))

    def angles(self, x: float, y: float, z: float) -> Place:
        """Return the joint angles, rad, for a place of the foot in the base, m.

        Raises
        ------
        InvalidInput
            When the place is too far or too close for the leg.
        """
        p = self._in_hip(x, y, z)
        # The hip turns the plane of the other two joints until the foot is in it.
        middle, half = self._hip_turn(p)
        hip = math.remainder(middle + self._hip * half, math.tau)
        c, s = math.cos(hip), math.sin(hip)
        # The same point in the link of the hip, which has turned by this angle.
        ax, ay, az = self._frame[0]
        dot = (ax * p[0] + ay * p[1] + az * p[2]) * (1.0 - c)
        w = (
            c * p[0] - s * (ay * p[2] - az * p[1]) + dot * ax,
            c * p[1] - s * (az * p[0] - ax * p[2]) + dot * ay,
            c * p[2] - s * (ax * p[1] - ay * p[0]) + dot * az,
        )
        one, two, origin = self._plane
        w = (w[0] - origin[0], w[1] - origin[1], w[2] - origin[2])
        u = one[0] * w[0] + one[1] * w[1] + one[2] * w[2]
        v = two[0] * w[0] + two[1] * w[1] + two[2] * w[2]
        upper, lower = self._lengths
        bend = (u * u + v * v - upper * upper - lower * lower) / (2.0 * upper * lower)
        if abs(bend) > 1.0 + _ROUNDING:
            raise InvalidInput(
                f'foot {math.hypot(u, v):.4g} m from the second joint of the leg is out of reach:'
                f' {abs(upper - lower):.4g} to {upper + lower:.4g} m is needed, with the hip on'
                ' the side of home'
            )
        fold = self._knee * math.acos(max(-1.0, min(1.0, bend)))
        turned = fold - self._fold  # of the last link against the one before
        side_x, side_y = self._upper
        start = math.atan2(side_y, side_x)
        end_x = upper + lower * math.cos(fold)
        end_y = lower * math.sin(fold)
        thigh = math.atan2(v, u) - math.atan2(end_y, end_x) - start
        found = (
            hip,
            math.remainder(thigh, math.tau),
            math.remainder(self._sense * turned, math.tau),
        )
        return self._within_half_a_turn(found) if self._far else found

    def _within_half_a_turn(self, angles: Place) -> Place:
        """Return the same angles, rad, at most half a turn from home."""
        hip, thigh, knee = (
            angle + math.tau * round((home - angle) / math.tau)
            for angle, home in zip(angles, self._home, strict=True)
        )
        return hip, thigh, knee


class FeetSolver:
    """Joint positions of all legs for places of the feet.

    In closed form where :class:`LegSolver` fits, else by Newton's method from the last solution.

    Parameters
    ----------
    robot : Robot
    """

    def __init__(self, robot: Robot) -> None:
        self._robot = robot
        legs = zip(robot.chains.legs, robot.chains.feet, robot.home.tolist(), strict=True)
        self._legs = [LegSolver(*leg) for leg in legs if LegSolver.fits(*leg[:2])]
        self._closed = len(self._legs) == len(robot.legs)
        self._near = robot.home

    def angles(self, feet: Sequence[Place]) -> list[float]:
        """Return all joint positions, rad, for places of the feet in the base, m.

        Raises
        ------
        InvalidInput
            When a foot does not reach its place; the message names the leg.
        """
        if not self._closed:
            self._near = self._robot.joint_positions(np.array(feet), self._near)
            found: list[float] = self._near.ravel().tolist()
            return found
        angles: list[float] = []
        try:
            for leg, place in zip(self._legs, feet, strict=True):
                angles += leg.angles(*place)
        except InvalidInput as error:
            raise InvalidInput(f'leg {self._robot.legs[len(angles) // 3]}: {error}') from error
        return angles


def _normal_to(line: Array) -> Array:
    """Return a unit vector normal to a unit vector."""
    other = cross(line, np.eye(3)[np.abs(line).argmin()])
    return np.asarray(other / np.linalg.norm(other))

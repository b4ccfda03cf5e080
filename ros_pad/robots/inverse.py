# SPDX-License-Identifier: Apache-2.0
"""Joint positions that bring the feet to given places, fast enough for every step of a walk."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from ros_pad.errors import InvalidInput
from ros_pad.robots.chains import Chains, Joint
from ros_pad.robots.robot import Robot
from ros_pad.robots.rotation import Array, cross

Place = tuple[float, float, float]

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
        turn = thigh.at[:3, :3] @ knee.at[:3, :3]
        across = thigh.at[:3, :3] @ thigh.axis  # axis of the thigh, in the link of the hip
        ahead = _normal_to(across)
        up = cross(across, ahead)
        lean = float(hip.axis @ across)
        sine = math.sqrt(1.0 - lean * lean)
        # In the axes of the hip: normal to the leg's plane, in the plane, and its own axis.
        inside = cross(hip.axis, across) / sine
        frame = np.array((cross(inside, hip.axis), inside, hip.axis))
        base = frame @ hip.at[:3, :3].T
        self._base: list[float] = base.ravel().tolist()
        self._at: list[float] = hip.at[:3, 3].tolist()
        self._plane: list[float] = np.ravel(
            [frame @ each for each in (thigh.at[:3, 3], ahead, up)]
        ).tolist()
        upper = thigh.at[:3, :3] @ knee.at[:3, 3]
        lower = turn @ foot[:3, 3]
        self._side = (float(across @ (thigh.at[:3, 3] + upper + lower)), lean, sine)
        upper_x, upper_y = float(ahead @ upper), float(up @ upper)
        lower_x, lower_y = float(ahead @ lower), float(up @ lower)
        one, two = math.hypot(upper_x, upper_y), math.hypot(lower_x, lower_y)
        self._links = one, two, one * one, two * two, 2.0 * one * two
        self._start = math.atan2(upper_y, upper_x)
        self._fold = math.atan2(lower_y, lower_x) - self._start
        self._sense = 1.0 if float(turn @ knee.axis @ across) > 0.0 else -1.0
        bend = math.remainder(self._sense * home[2] + self._fold, math.tau)
        self._knee = 1.0 if bend >= 0.0 else -1.0
        place = Chains([joints], foot[None]).solve(np.array([home])).positions[0]
        near, far, _ = base @ (place - hip.at[:3, 3])
        middle = math.atan2(far, near)
        self._hip = 1.0 if math.remainder(home[0] - middle, math.tau) >= 0.0 else -1.0
        self._home = home
        self._far = max(map(abs, home)) > 0.5 * math.pi

    @staticmethod
    def fits(joints: Sequence[Joint], foot: Array) -> bool:
        """Return whether a leg has three joints that turn, the last two parallel and apart."""
        if len(joints) != 3 or any(joint.slides for joint in joints):
            return False
        hip, thigh, knee = joints
        across = thigh.at[:3, :3] @ thigh.axis
        last = thigh.at[:3, :3] @ knee.at[:3, :3] @ knee.axis
        parallel = np.abs(cross(across, last)).max() < 1e-9
        links = cross(thigh.axis, knee.at[:3, 3]), cross(knee.axis, foot[:3, 3])
        apart = min(np.abs(link).max() for link in links) > 1e-6  # m
        return bool(parallel and apart and np.abs(cross(hip.axis, across)).max() > 1e-3)

    def angles(self, x: float, y: float, z: float) -> list[float]:
        """Return the joint angles, rad, for a place of the foot in the base, m.

        Raises
        ------
        InvalidInput
            When the place is too far or too close for the leg.
        """
        (at_x, at_y, at_z), (a, b, c, d, e, f, g, h, i) = self._at, self._base
        x, y, z = x - at_x, y - at_y, z - at_z
        near, far, along = a * x + b * y + c * z, d * x + e * y + f * z, g * x + h * y + i * z
        # The hip turns the plane of the other two joints until the foot is in it.
        side, lean, sine = self._side
        side, size = side - lean * along, sine * math.hypot(near, far)
        share = side / size if size else math.inf
        if not -1.0 <= share <= 1.0:
            share = self._cosine(side, size)
        hip = math.remainder(math.atan2(far, near) + self._hip * math.acos(share), math.tau)
        c, s = math.cos(hip), math.sin(hip)
        # The same place in the link of the hip, which has turned by this angle. The last sum is
        # `along` but for its rounding, and walks hang on the last bit.
        near, far, along = c * near + s * far, c * far - s * near, c * along + along * (1.0 - c)
        at_x, at_y, at_z, a, b, c, d, e, f = self._plane
        near, far, along = near - at_x, far - at_y, along - at_z
        u, v = a * near + b * far + c * along, d * near + e * far + f * along
        upper, lower, upper2, lower2, double = self._links
        bend = (u * u + v * v - upper2 - lower2) / double
        if not -1.0 <= bend <= 1.0:
            bend = self._bent(bend, math.hypot(u, v))
        fold = self._knee * math.acos(bend)
        end = math.atan2(lower * math.sin(fold), upper + lower * math.cos(fold))
        thigh = math.remainder(math.atan2(v, u) - end - self._start, math.tau)
        knee = math.remainder(self._sense * (fold - self._fold), math.tau)
        found = [hip, thigh, knee]
        if self._far:  # the same angles may be more than half a turn from home
            for index, (angle, home) in enumerate(zip(found, self._home, strict=True)):
                if abs(angle - home) > math.pi:
                    found[index] = angle + math.tau * round((home - angle) / math.tau)
        return found

    @staticmethod
    def _cosine(side: float, size: float) -> float:
        """Return the cosine of half of the difference of the two hip angles that fit."""
        if abs(side) > size * (1.0 + _ROUNDING):
            raise InvalidInput(
                f'foot {size:.4g} m from the axis of the hip is out of reach: at least'
                f' {abs(side):.4g} m is needed'
            )
        return math.copysign(1.0, side) if size else 1.0

    def _bent(self, bend: float, away: float) -> float:
        """Return the cosine of the fold of the knee for a foot that far away, m."""
        if abs(bend) > 1.0 + _ROUNDING:
            upper, lower = self._links[:2]
            raise InvalidInput(
                f'foot {away:.4g} m from the second joint of the leg is out of reach:'
                f' {abs(upper - lower):.4g} to {upper + lower:.4g} m is needed, with the hip on'
                ' the side of home'
            )
        return math.copysign(1.0, bend)


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
        for name, leg, place in zip(self._robot.legs, self._legs, feet, strict=True):
            try:
                angles += leg.angles(*place)
            except InvalidInput as error:
                raise InvalidInput(f'leg {name}: {error}') from error
        return angles


def _normal_to(line: Array) -> Array:
    """Return a unit vector normal to a unit vector."""
    other = cross(line, np.eye(3)[np.abs(line).argmin()])
    return np.asarray(other / np.linalg.norm(other))

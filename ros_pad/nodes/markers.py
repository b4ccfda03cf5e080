# SPDX-License-Identifier: Apache-2.0
"""The walk as markers, for RViz and Foxglove: soles, forces, wet ground."""

from __future__ import annotations

import copy
import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from ros_pad.bags.codec import message_type
from ros_pad.contact.pad import DOME_PRESSURE
from ros_pad.pace import Pace
from ros_pad.records import split
from ros_pad.simulation.robot import FootState, SimulatedRobot
from ros_pad.simulation.scene import Scene
from ros_pad.simulation.terrain import Floor

ARRAY = message_type('visualization_msgs/msg/MarkerArray')
"""Type of the messages. Classes of rclpy check each number, and take ten times as long."""

_MARKER = ARRAY.blank('visualization_msgs/msg/Marker')
Marker, Header, Time = type(_MARKER), type(_MARKER.header), type(_MARKER.header.stamp)
Pose, Point, Vector3 = type(_MARKER.pose), type(_MARKER.pose.position), type(_MARKER.scale)
Quaternion, ColorRGBA = type(_MARKER.pose.orientation), type(_MARKER.color)

FORCE_SCALE = 0.01
"""Length of an arrow for one newton, m."""

CELL = 0.05
"""Edge of a square of floor that is drawn wet or dry, m."""

_SIGHT, _BREADTH = 1.5, 0.6  # floor is shown so far ahead of and behind the body, and beside it, m
_SLOW_NS = 1_000_000_000  # floor is a large message: once a second is enough

# Okabe and Ito's colours, as in reports.
_WET = (0.337, 0.706, 0.914)
_DRY = (0.902, 0.624, 0.0)
_SWING = (0.6, 0.6, 0.6)
_SLIPPING = (0.835, 0.369, 0.0)
_BLACK = (0.0, 0.0, 0.0)


class WalkMarkers:
    """Make the markers of one walk.

    Soles are discs: thin when flat, thick when domed; blue on wet ground, yellow on dry ground,
    grey in swing. Arrows are ground forces, red where the foot slips faster than 5 mm/s. All are
    in the frame ``world``; each keeps its namespace and id, so that a new one replaces the old
    one.

    Parameters
    ----------
    scene : Scene
        Scene of the walk.
    floor : Floor
        Floor of the scene, built with the seed of the walk.
    """

    def __init__(self, scene: Scene, floor: Floor) -> None:
        self._scene = scene
        self._floor = floor
        self._slow_pace = Pace(_SLOW_NS)

    def message(self, robot: SimulatedRobot, pressures: Sequence[float], time_ns: int) -> Any:
        """Return the markers of this moment.

        Parameters
        ----------
        robot : SimulatedRobot
            The robot in its present state.
        pressures : sequence of float
            Pressures of the pads, gauge Pa, in the order of the robot's legs.
        time_ns : int
            Time stamp of the markers, ns.
        """
        seconds, nanoseconds = split(time_ns)
        stamp = Time(sec=seconds, nanosec=nanoseconds)
        array = ARRAY.blank()
        for leg, foot, pressure in zip(robot.legs, robot.feet, pressures, strict=True):
            array.markers.append(self._sole(leg, foot, pressure))
            array.markers.append(self._force(leg, foot))
        if self._slow_pace.due(time_ns):
            array.markers.append(self._ground(*robot.body[:2]))
        for marker in array.markers:
            marker.header.stamp = stamp
        return array

    def _sole(self, leg: int, foot: FootState, pressure: float) -> Any:
        x, y, z = foot.position
        marker = _marker('soles', leg, _MARKER.CYLINDER)
        height = 0.006 if pressure > DOME_PRESSURE else 0.002
        ground = self._floor.height(x, y) if foot.standing else z
        marker.pose.position = Point(x=x, y=y, z=ground + 0.5 * height)
        diameter = 2.0 * self._scene.foot.sole_radius
        marker.scale = Vector3(x=diameter, y=diameter, z=height)
        marker.color = _colour((_WET if foot.wet else _DRY) if foot.standing else _SWING)
        return marker

    def _force(self, leg: int, foot: FootState) -> Any:
        marker = _marker('forces', leg, _MARKER.ARROW)
        x, y, _ = foot.position
        fx, fy, fz = (FORCE_SCALE * each for each in foot.force)
        if not foot.standing or not math.hypot(fx, fy, fz) > 0.0:
            marker.action = _MARKER.DELETE
            return marker
        z = self._floor.height(x, y)
        marker.points = [Point(x=x, y=y, z=z), Point(x=x + fx, y=y + fy, z=z + fz)]
        marker.scale = Vector3(x=0.006, y=0.012, z=0.015)  # shaft, head, length of head
        marker.color = _colour(_SLIPPING if foot.slip_speed > 0.005 else _BLACK)
        return marker

    def _ground(self, x: float, y: float) -> Any:
        """Return the wet floor around the body, square by square."""
        columns, rows = round(2.0 * _SIGHT / CELL), round(2.0 * _BREADTH / CELL)
        first = math.floor((x - _SIGHT) / CELL), math.floor((y - _BREADTH) / CELL)
        xs = (first[0] + np.arange(columns) + 0.5) * CELL
        ys = (first[1] + np.arange(rows) + 0.5) * CELL
        across, along = np.meshgrid(xs, ys)
        wet = self._floor.wet_along(across, along)
        marker = _marker('wet ground', 0, _MARKER.CUBE_LIST)
        places = zip(across[wet].tolist(), along[wet].tolist(), strict=True)
        marker.points = [Point(x=left, y=fore, z=0.0) for left, fore in places]
        marker.scale = Vector3(x=CELL, y=CELL, z=0.001)
        marker.color = _colour(_WET, 0.5)
        if not marker.points:
            marker.action = _MARKER.DELETE
        return marker


def marker_of_foot(leg: int, x: float, y: float, wetness: float) -> Any:
    """Return a foot at a place, m, in a colour from dry to wet by its P(wet); grey for NaN."""
    marker = _marker('feet', leg, _MARKER.SPHERE)
    marker.pose.position = Point(x=x, y=y, z=0.01)
    marker.scale = Vector3(x=0.02, y=0.02, z=0.02)
    share = min(max(wetness, 0.0), 1.0)
    red, green, blue = (d + share * (w - d) for d, w in zip(_DRY, _WET, strict=True))
    marker.color = _colour(_SWING if math.isnan(wetness) else (red, green, blue))
    return marker


def _marker(name: str, number: int, kind: int) -> Any:
    marker = copy.copy(_MARKER)
    marker.ns, marker.id, marker.type = name, number, kind
    marker.header = Header(stamp=Time(sec=0, nanosec=0), frame_id='world')
    marker.pose = Pose(
        position=Point(x=0.0, y=0.0, z=0.0), orientation=Quaternion(x=0.0, y=0.0, z=0.0, w=1.0)
    )
    marker.points = []
    return marker


def _colour(rgb: tuple[float, float, float], opacity: float = 1.0) -> Any:
    red, green, blue = rgb
    return ColorRGBA(r=red, g=green, b=blue, a=opacity)

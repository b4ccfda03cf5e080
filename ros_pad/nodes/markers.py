# SPDX-License-Identifier: Apache-2.0
"""The walk as markers, for RViz and Foxglove: soles, forces, wet ground."""

from __future__ import annotations

import functools
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

# Classes of rclpy check each number, and take ten times as long.
ARRAY = message_type('visualization_msgs/msg/MarkerArray')

_KIND = 'visualization_msgs/msg/Marker'
_MARKER = ARRAY.blank(_KIND)
_Point = type(_MARKER.pose.position)

FORCE_SCALE = 0.01
"""Length of an arrow for one newton, m."""

MARKERS_PERIOD_NS = 100_000_000
"""Time between two messages of markers, ns."""

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

    def message(self, robot: SimulatedRobot, pressures: Sequence[float], time_ns: int) -> bytes:
        """Return the message of this moment, as bytes.

        Parameters
        ----------
        robot : SimulatedRobot
            The robot in its present state.
        pressures : sequence of float
            Pressures of the pads, gauge Pa, in the order of the robot's legs.
        time_ns : int
            Time stamp of the markers, ns.
        """
        markers = []
        for leg, foot, pressure in zip(robot.legs, robot.feet, pressures, strict=True):
            markers += [self._sole(leg, foot, pressure), self._force(leg, foot)]
        if self._slow_pace.due(time_ns):
            markers.append(self._ground(*robot.body[:2]))
        return array_of(markers, time_ns, 'world')

    def _sole(self, leg: int, foot: FootState, pressure: float) -> Any:
        x, y, z = foot.position
        height = 0.006 if pressure > DOME_PRESSURE else 0.002
        if foot.standing:
            z = self._floor.height(x, y)
        diameter = 2.0 * self._scene.foot.sole_radius
        colour = (_WET if foot.wet else _DRY) if foot.standing else _SWING
        marker = _marker('soles', leg, _MARKER.CYLINDER, (diameter, diameter, height), colour)
        _put(marker.pose.position, 'xyz', (x, y, z + 0.5 * height))
        return marker

    def _force(self, leg: int, foot: FootState) -> Any:
        x, y, _ = foot.position
        fx, fy, fz = (FORCE_SCALE * each for each in foot.force)
        sizes = 0.006, 0.012, 0.015  # of shaft and head, and length of the head
        colour = _SLIPPING if foot.slip_speed > 0.005 else _BLACK
        marker = _marker('forces', leg, _MARKER.ARROW, sizes, colour)
        if not foot.standing or not math.hypot(fx, fy, fz) > 0.0:
            marker.action = _MARKER.DELETE
            return marker
        z = self._floor.height(x, y)
        marker.points = [_Point(x=x, y=y, z=z), _Point(x=x + fx, y=y + fy, z=z + fz)]
        return marker

    def _ground(self, x: float, y: float) -> Any:
        """Return the wet floor around the body, square by square."""
        columns, rows = round(2.0 * _SIGHT / CELL), round(2.0 * _BREADTH / CELL)
        first = math.floor((x - _SIGHT) / CELL), math.floor((y - _BREADTH) / CELL)
        xs = (first[0] + np.arange(columns) + 0.5) * CELL
        ys = (first[1] + np.arange(rows) + 0.5) * CELL
        across, along = np.meshgrid(xs, ys)
        wet = self._floor.wet_along(across, along)
        marker = _marker('wet ground', 0, _MARKER.CUBE_LIST, (CELL, CELL, 0.001), _WET, 0.5)
        places = zip(across[wet].tolist(), along[wet].tolist(), strict=True)
        marker.points = [_Point(x=left, y=fore, z=0.0) for left, fore in places]
        if not marker.points:
            marker.action = _MARKER.DELETE
        return marker


def marker_of_foot(leg: int, place: Sequence[float], wetness: float) -> Any:
    """Return a foot at x, y, m, in a colour from dry to wet by its P(wet); grey for NaN."""
    share = min(max(wetness, 0.0), 1.0)
    colour = tuple(d + share * (w - d) for d, w in zip(_DRY, _WET, strict=True))
    colour = _SWING if math.isnan(wetness) else colour
    marker = _marker('feet', leg, _MARKER.SPHERE, (0.02, 0.02, 0.02), colour)
    _put(marker.pose.position, 'xyz', (*place, 0.01))
    return marker


def array_of(markers: Sequence[Any], time_ns: int, frame: str) -> bytes:
    """Return the bytes of a message with markers of a time, ns, in a frame."""
    array = ARRAY.blank()
    array.markers = list(markers)
    for marker in markers:
        marker.header.frame_id = frame
        _put(marker.header.stamp, ('sec', 'nanosec'), split(time_ns))
    return ARRAY.encode(array)


def _marker(
    name: str,
    number: int,
    kind: int,
    sizes: Sequence[float],
    rgb: Sequence[float],
    opacity: float = 1.0,
) -> Any:
    marker = _blank(name, number)  # encoded before it is filled again
    marker.ns, marker.id, marker.type, marker.action = name, number, kind, _MARKER.ADD
    marker.pose.orientation.w = 1.0
    marker.points = []
    _put(marker.scale, 'xyz', sizes)
    _put(marker.color, 'rgba', (*rgb, opacity))
    return marker


@functools.cache
def _blank(name: str, number: int) -> Any:
    return ARRAY.blank(_KIND)  # takes 0.1 ms


def _put(part: Any, names: Sequence[str], values: Sequence[float]) -> None:
    for name, value in zip(names, values, strict=True):
        setattr(part, name, value)

# SPDX-License-Identifier: Apache-2.0
import itertools

import pytest
from rclpy.serialization import deserialize_message
from visualization_msgs.msg import Marker, MarkerArray

from ros_pad.nodes.markers import CELL, FORCE_SCALE, WalkMarkers
from ros_pad.simulation import fidelity
from ros_pad.simulation.scene import Scene

DT = 0.004


def walked(scene_name, seconds, pressure=0.0):
    """Yield scene, floor, robot and its markers, serialized and read again, every 0.1 s."""
    scene = Scene.load(scene_name)
    floor = scene.floor.build(0)
    robot = fidelity.build(scene, floor, DT, 'L0' if scene.robot == 'rail_leg' else 'L1')
    markers = WalkMarkers(scene, floor)
    pressures = [pressure] * len(scene.legs)
    for step in range(round(seconds / DT)):
        robot.step(pressures)
        if step % 25 == 0:
            message = markers.message(robot, pressures, round(robot.time * 1e9))
            wire = deserialize_message(message, MarkerArray)
            yield scene, floor, robot, {(each.ns, each.id): each for each in wire.markers}


def test_soles_and_forces_are_where_the_feet_are():
    standing = swinging = wet = 0
    for scene, _, robot, drawn in walked('hexapod_patches', 24.0, 75e3):
        for leg, foot in zip(robot.legs, robot.feet, strict=True):
            sole, force = drawn['soles', leg], drawn['forces', leg]
            assert sole.header.frame_id == force.header.frame_id == 'world'
            x, y = sole.pose.position.x, sole.pose.position.y
            assert (x, y) == pytest.approx(foot.position[:2])
            assert sole.scale.x == pytest.approx(2 * scene.foot.sole_radius)
            assert (sole.type, force.type) == (Marker.CYLINDER, Marker.ARROW)
            if not foot.standing:
                swinging += 1
                assert force.action == Marker.DELETE
                continue
            standing += 1
            tail, head = force.points
            arrow = (head.x - tail.x, head.y - tail.y, head.z - tail.z)
            assert arrow == pytest.approx([FORCE_SCALE * each for each in foot.force])
            assert head.z > tail.z  # the ground pushes up
            blue = sole.color.b > sole.color.r
            assert blue == foot.wet
            wet += blue
    assert min(standing, swinging, wet, standing - wet) > 20


def test_wet_ground_is_drawn_where_it_is_wet_and_nowhere_else():
    _, floor, _, drawn = next(walked('hexapod_patches', 0.1))
    ground = drawn['wet ground', 0]
    assert ground.type == Marker.CUBE_LIST and ground.scale.x == CELL
    drawn_at = {(round(p.x / CELL - 0.5), round(p.y / CELL - 0.5)) for p in ground.points}
    for column, row in itertools.product(range(-20, 20), range(-10, 10)):
        wet = floor.wet((column + 0.5) * CELL, (row + 0.5) * CELL)
        assert ((column, row) in drawn_at) == wet

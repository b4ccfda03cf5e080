# SPDX-License-Identifier: Apache-2.0
import dataclasses
import math

import numpy as np
import pytest
from scipy.optimize import minimize_scalar

from ros_pad.errors import InvalidInput
from ros_pad.simulation import Scene
from ros_pad.simulation.planar_robot import PlanarRobot
from ros_pad.simulation.rail_leg import RailLeg, push
from ros_pad.simulation.scene import FloorPlan, RailBody, RailGait

SHIPPED = Scene.load('leg_dry_flat')
MASS, DRAG, LOAD = 1.0, 0.5, 2.0
STROKE, STANCE, SWING = 0.05, 0.5, 0.5


def scene_of(cap, drag=DRAG, settle=0.0, **gait):
    """Return a scene on dry ground whose flat foot holds exactly ``cap`` newtons."""
    foot = dataclasses.replace(SHIPPED.foot, friction=cap / LOAD, shear_strength=0.0)
    values = {'stroke': STROKE, 'stance': STANCE, 'swing': SWING, 'lift': 0.02} | gait
    return dataclasses.replace(
        SHIPPED,
        body=RailBody(mass=MASS, rolling_drag=drag, load=LOAD, goal=1.0),
        gait=RailGait(**values),
        foot=foot,
        floor=FloorPlan('dry', 3e-4, 1e-3),
        settle=settle,
    )


def leg_of(scene, period=1e-3, kind=RailLeg):
    return kind(scene, scene.floor.build(0), period)


def walk(leg, cycles, each=lambda: None):
    for _ in range(round(cycles * (STANCE + SWING) / leg.period)):
        leg.step([0.0])
        each()
    return leg.body[0]


class SteadyLeg(RailLeg):
    """A leg whose foot goes back at constant speed in stance, as the closed form assumes."""

    def plan(self, time):
        stands, offset, height = super().plan(time)
        since = time % (STANCE + SWING)
        if stands:
            offset = STROKE * (0.5 - since / STANCE)
        return stands, offset, height


def test_closed_form_of_a_slipping_foot():
    """At constant foot speed the distance is ½ a Ts² (1 + a M/F) with a = (c - F)/M.

    The body gains the speed a Ts in a stance, and coasts v²/(2 F/M) in the swing. The formula is
    valid while a Ts is below the speed of the foot, 0.1 m/s, and coasting ends within the swing.
    """
    for cap in (0.51, 0.55, 0.65):
        a = (cap - DRAG) / MASS
        assert a * STANCE < STROKE / STANCE and a * STANCE * MASS / DRAG < SWING
        expected = 0.5 * a * STANCE**2 * (1.0 + a * MASS / DRAG)
        errors = []
        for period in (2e-3, 1e-3, 5e-4):
            leg = leg_of(scene_of(cap), period, SteadyLeg)
            errors.append(walk(leg, 1.0) / expected - 1.0)
        assert abs(errors[1]) < 0.01
        assert abs(errors[2]) < 0.6 * abs(errors[1]) < 0.36 * abs(errors[0]) * 1.05


def test_strong_foot_takes_the_body_along():
    """A foot that does not slip needs c > M π² S/(2 Ts²) + F = 1.49 N."""
    leg = leg_of(scene_of(1.6))
    moved = walk(leg, 10.0)
    assert moved == pytest.approx(10 * STROKE, rel=2e-3)
    assert leg.feet[0].slip_path < 1e-3 * moved
    assert leg.dissipation < 1e-3
    weak = leg_of(scene_of(1.3))
    walk(weak, 10.0)
    assert weak.feet[0].slip_path > 1e-3


@pytest.mark.parametrize('cap', [0.0, 0.3, 0.499])
def test_threshold(cap):
    """A foot that holds less than the drag of the wheels slips and does not move the body."""
    leg = leg_of(scene_of(cap))
    assert walk(leg, 3.0) == 0.0
    assert leg.feet[0].slip_path == pytest.approx(3 * STROKE, rel=1e-2)
    assert leg.dissipation == pytest.approx(3 * STROKE * cap, rel=1e-2)


def test_step_is_the_minimum_of_its_convex_function():
    """A step minimises ½ (v - v0)² + (dt/M) (c |v - u| + F |v|); here by golden section."""
    body = scene_of(1.0).body
    rng = np.random.default_rng(0)
    seen = set()
    for _ in range(300):
        before, back = rng.uniform(-0.2, 0.2, 2)
        cap = rng.choice([0.0, rng.uniform(0.0, 3.0)])
        dt = rng.choice([1e-3, 0.05, 0.2])

        def function(v, before=before, back=back, cap=cap, dt=dt):
            return 0.5 * (v - before) ** 2 + dt / MASS * (cap * abs(v - back) + DRAG * abs(v))

        found = minimize_scalar(
            function, bounds=(-0.5, 0.5), method='bounded', options={'xatol': 1e-12}
        ).x
        speed, force = push(before, back, cap, body, dt)
        assert speed == pytest.approx(found, abs=2e-7)
        assert function(speed) <= function(found) + 1e-15
        assert abs(force) <= cap + 1e-12
        seen.add('rest' if speed == 0.0 else 'stick' if speed == back else 'slip')
    assert seen == {'rest', 'stick', 'slip'}


def test_dissipation_is_the_work_of_the_slipping_foot():
    """Work of the foot's drive is lost in slip and wheels or becomes kinetic energy."""
    leg = leg_of(scene_of(0.6), 2e-4)
    put_in, rolled = [0.0], [0.0]
    last = [0.0, leg.feet[0].position[0]]

    def note():
        x = leg.body[0]
        rolled[0] += DRAG * abs(x - last[0])
        foot = x + leg.plan(leg.time)[1]
        back = (x - last[0]) - (foot - last[1])  # motion of the body over the foot
        put_in[0] += leg.feet[0].force[0] * back
        last[:] = [x, foot]

    last[1] = leg.plan(0.0)[1]
    walk(leg, 2.3, note)
    kinetic = 0.5 * MASS * leg.speed**2
    assert put_in[0] == pytest.approx(leg.dissipation + rolled[0] + kinetic, rel=5e-3)
    assert leg.dissipation > 0.1 * rolled[0]


def test_wet_domes_and_their_limit():
    """Pressures change film, load sharing and overload of the foot."""
    wet = dataclasses.replace(SHIPPED, floor=FloorPlan('wet', 3e-4, 1e-3), settle=0.0)
    grips = {}
    for pressure in (0.0, 60e3, 75e3):
        leg = leg_of(wet, 0.004)
        for _ in range(120):
            leg.step([pressure])
        grips[pressure] = leg.feet[0].grip
        assert leg.feet[0].wet
        # 19 pads carry 1.82 N of the 2.5 N at 60 kPa, and all of it at 75 kPa.
        assert (leg.feet[0].overload_time > 0.0) == (pressure == 60e3)
    assert grips[0.0] == pytest.approx(0.12 * 2.5, rel=1e-3)
    assert grips[0.0] < grips[60e3] < grips[75e3]


# --- slopes, and many legs at once --------------------------------------------------------------


def on_slope(scene, slope):
    return dataclasses.replace(scene, floor=dataclasses.replace(scene.floor, slope=slope))


def test_a_foot_that_lands_on_wet_ground_does_not_grip_as_on_dry_ground():
    """Friction grows over a stance; at touch-down it is less than when half of the load is on."""
    scene = dataclasses.replace(Scene.load('leg_wet_dome_75'), cycles=3)
    leg, grips = leg_of(scene, 0.004), []
    while leg.time < scene.settle + 2.5 * scene.gait.cycle:
        leg.step([75e3])
        grips.append((leg.time, leg.feet[0].grip))
    time, grip = np.array(grips).T
    lands = scene.settle + scene.gait.cycle
    stance = grip[(time >= lands - 1e-6) & (time < lands + 0.5 * scene.gait.stance)]
    assert stance[0] < stance[2] < stance[-1]


def test_wheels_hold_up_to_their_drag_and_roll_above():
    """Without grip the body rests while M g sin(slope) < F, else a = g sin(slope) - F/M."""
    limit = math.asin(DRAG / (MASS * 9.81))
    assert walk(leg_of(on_slope(scene_of(0.0), 0.99 * limit)), 2.0) == 0.0
    steep = 3.0 * limit
    fallen = walk(leg_of(on_slope(scene_of(0.0), steep), 1e-4), 0.5)
    expected = -0.5 * (9.81 * math.sin(steep) - DRAG / MASS) * 0.5**2
    assert fallen == pytest.approx(expected, rel=1e-3)


@pytest.mark.parametrize('pressures', [[], [math.nan]])
def test_bad_pressures(pressures):
    leg = leg_of(SHIPPED)
    with pytest.raises(InvalidInput, match=r'pressures = .* Pa is not allowed: 1 finite numbers'):
        leg.step(pressures)
    assert leg.time == 0.0


def test_a_scene_of_another_robot_is_refused():
    hexapod = Scene.load('hexapod_patches')
    with pytest.raises(InvalidInput, match=r'hexapod_patches.* a rail leg is needed'):
        leg_of(hexapod)
    with pytest.raises(InvalidInput, match=r'leg_dry_flat.* a robot with legs is needed'):
        PlanarRobot(SHIPPED, SHIPPED.floor.build(0), 0.004)

# SPDX-License-Identifier: Apache-2.0
"""The planar step has the physics of gait, foot, film and floor; compiled, it is bit-identical."""

import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ros_pad.contact import laws
from ros_pad.errors import ConfigError, InvalidInput
from ros_pad.simulation import Scene, compiled, planar_step
from ros_pad.simulation.gait import WalkingGait
from ros_pad.simulation.planar_model import model_of
from ros_pad.simulation.planar_robot import PlanarRobot

SCENE = Scene.load('hexapod_patches')
FLOOR = SCENE.floor.build(0)
MODEL = model_of(SCENE, FLOOR, 0.004)
UNEVEN = FLOOR.uneven(2e-3, 1)
BUMPY = model_of(SCENE, UNEVEN, 0.004)
LEGS = (1, 2, 3, 4, 5, 6)


def films():
    return [[0.0] * (laws.FILM + laws.CELLS) for _ in LEGS]


def table():
    return [[0.0] * 6 for _ in range(planar_step.FEET)]


# --- the same as gait, foot, film and floor -----------------------------------------------------


@given(
    st.floats(0.0, 500.0),
    st.floats(0.1, 20.0),
    st.floats(0.51, 0.9),
    st.floats(1e-3, 1.0),
)
def test_gait(time, cycle, duty, stride):
    gait = WalkingGait(cycle, stride, duty, 0.03, SCENE.gait.middles, pushes=True)
    own = MODEL._replace(
        gait=MODEL.gait._replace(
            cycle=cycle, stride=stride, duty=duty, lift=0.03, reach=gait.reach(), heading_gain=0.0
        )
    )
    feet, body = table(), [0.0] * planar_step.BODY
    planar_step.move_feet(own, body, feet, films(), time, time)
    for index, leg in enumerate(LEGS):
        phase = gait.phase(leg - 1, time)
        assert feet[planar_step.PHASE][index] == phase
        if phase >= duty:
            progress, height = gait.swing(phase)
            assert feet[planar_step.HEIGHT][index] == height
            assert feet[planar_step.OFFSET_X][index] == pytest.approx(
                progress * gait.reach(), abs=1e-15
            )


@given(st.floats(-100.0, 100.0), st.floats(-100.0, 100.0))
def test_floor(x, y):
    assert planar_step.is_wet(BUMPY, x, y) == UNEVEN.wet(x, y)
    feet, body = table(), [0.0] * planar_step.BODY
    body[planar_step.X], body[planar_step.Y] = x, y
    planar_step.touch_down(BUMPY, body, feet, films()[4], 4)
    home_x, home_y = SCENE.body.homes[4]
    assert feet[planar_step.GROUND][4] == UNEVEN.height(x + home_x, y + home_y)


# --- loads --------------------------------------------------------------------------------------


def balanced(weights, places, preloads, wanted):
    """Return loads w max(0, λ·(1, x, y) + k z) in balance, by trying all sets of feet, or None."""
    rows = np.column_stack([np.ones(len(places)), places])
    for size in range(len(weights), 2, -1):
        for chosen in itertools.combinations(range(len(weights)), size):
            some = list(chosen)
            share = rows[some].T * weights[some]
            matrix, right = share @ rows[some], wanted - share @ preloads[some]
            if np.linalg.cond(matrix) > 1e12:
                continue
            pressed = rows @ np.linalg.solve(matrix, right) + preloads
            others = np.delete(pressed, some)
            if (pressed[some] > 0.0).all() and (others <= 0.0).all():
                return np.where(pressed > 0.0, weights * pressed, 0.0)
    return None


def test_loads_by_trying_every_set_of_feet():
    """Six feet on uneven ground under random pushes: only feet that would pull have no load."""
    rng = np.random.default_rng(4)
    seen = {'all': 0, 'some': 0, 'tipped': 0}
    own = MODEL._replace(trunk=MODEL.trunk._replace(leg_stiffness=3000.0))
    for _ in range(400):
        feet, body = table(), [0.0] * planar_step.BODY
        # All feet stand, some with less than a full share.
        feet[planar_step.PHASE] = rng.uniform(0.02, own.gait.duty - 0.02, 6).tolist()
        feet[planar_step.OFFSET_X] = rng.uniform(-0.04, 0.04, 6).tolist()
        feet[planar_step.GROUND] = (rng.choice([0.0, 1e-3, 4e-3]) * rng.normal(size=6)).tolist()
        lean = rng.choice([0.0, 10.0, 60.0]) * rng.uniform(-1.0, 1.0, 2)
        body[planar_step.PUSH_X], body[planar_step.PUSH_Y] = lean
        planar_step.share_loads(own, body, feet)
        weights = np.array(
            [
                planar_step.load_share(own.gait.duty, own.gait.overlap, p)
                for p in feet[planar_step.PHASE]
            ]
        )
        places = np.array(SCENE.body.homes) + np.column_stack(
            [feet[planar_step.OFFSET_X], np.zeros(6)]
        )
        wanted = np.array([own.trunk.weight, *(-own.trunk.height * lean)])
        expected = balanced(weights, places, 3000.0 * np.array(feet[planar_step.GROUND]), wanted)
        if expected is None:
            seen['tipped'] += 1
            assert body[planar_step.TIPPED] in LEGS
            continue
        seen['all' if (expected > 0.0).all() else 'some'] += 1
        assert body[planar_step.TIPPED] == 0.0
        assert feet[planar_step.LOAD] == pytest.approx(expected, abs=1e-7)
    assert min(seen.values()) > 20


# --- friction -----------------------------------------------------------------------------------


def test_a_step_obeys_newtons_law():
    """Forces and moments of all contacts, stuck or slipping, are the change of momentum."""
    rng = np.random.default_rng(3)
    mass, inertia, dt, slipped = 2.0, 0.03, 0.004, 0
    for _ in range(100):
        contacts = [
            (*rng.uniform(-0.15, 0.15, 2), *rng.normal(0.0, 0.3, 2), rng.normal(0.0, 2.0), radius,
             rng.uniform(0.1, 5.0), 5e3 * dt)
            for radius in (0.011, 0.011, 0.011, 0.0)
        ]  # fmt: skip
        free = tuple(rng.normal(0.0, 0.3, 3))
        vx, vy, w, converged = planar_step.newton(free, mass, inertia, contacts, dt, free)
        assert converged
        pushes = [planar_step.push(vx, vy, w, each, dt) for each in contacts]
        force = np.array([each[:2] for each in pushes])
        moment = sum(
            each[0] * push[1] - each[1] * push[0] + push[2]
            for each, push in zip(contacts, pushes, strict=True)
        )
        change = mass * np.array([vx - free[0], vy - free[1]]), inertia * (w - free[2])
        assert force.sum(0) * dt == pytest.approx(change[0], abs=1e-9)
        assert moment * dt == pytest.approx(change[1], abs=1e-9)
        slipped += sum(each[3] > 0.0 for each in pushes)
    assert 50 < slipped < 400


# --- compiled -----------------------------------------------------------------------------------


@pytest.mark.slow
def test_compiled_walk_is_the_same_to_the_bit():
    pytest.importorskip('numba')
    scene = Scene.load('hexapod_rough_wet_flat')
    floor = scene.floor.build(1)
    plain, fast = (
        PlanarRobot(scene, floor, 0.004, compile_steps) for compile_steps in (False, True)
    )
    # Pads fill and empty, so that feet are domes, overloaded domes and flat.
    for step in range(600):
        pressures = [max(0.0, 80e3 * math.sin(0.01 * step + leg)) for leg in LEGS]
        plain.step(pressures)
        fast.step(pressures)
        if step % 50 == 0:
            assert plain.body == fast.body
            for one, other in zip(plain.feet, fast.feet, strict=True):
                for each in one.__slots__:
                    assert getattr(one, each) == getattr(other, each), each
                    assert type(getattr(one, each)) is type(getattr(other, each)), each
    assert fast.table.tolist() == plain.table
    assert fast.state.tolist() == plain.state
    assert plain.dissipation == fast.dissipation > 0.0


@pytest.mark.slow
def test_compiled_tip_over_and_refusals_are_the_same():
    pytest.importorskip('numba')
    from dataclasses import replace

    tall = replace(SCENE, body=replace(SCENE.body, height=1.5), settle=0.0)
    robots = [PlanarRobot(tall, FLOOR, 0.004, each) for each in (False, True)]
    for _ in range(1000):
        for robot in robots:
            robot.step([0.0] * 6)
    assert robots[0].verdict == robots[1].verdict
    assert 'would have to pull' in robots[0].verdict
    for robot in robots:
        for bad in ([0.0] * 5, [0.0] * 7, [math.nan] + [0.0] * 5, [math.inf] * 6):
            with pytest.raises(InvalidInput, match='6 finite numbers'):
                robot.step(bad)
        robot.step([0] * 6)


def test_without_numba_an_extra_is_named(monkeypatch):
    monkeypatch.setitem(__import__('sys').modules, 'numba', None)
    with pytest.raises(ConfigError, match=r'pip install "ros_pad\[fast\]"'):
        compiled.dispatcher.__wrapped__(planar_step)

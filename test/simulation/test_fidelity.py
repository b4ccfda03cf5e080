# SPDX-License-Identifier: Apache-2.0

import pytest

from ros_pad import configuration
from ros_pad.errors import InvalidInput
from ros_pad.simulation import Scene
from ros_pad.simulation import fidelity
from ros_pad.simulation.planar_hexapod import PlanarHexapod
from ros_pad.simulation.rail_leg import RailLeg

HEXAPOD, LEG = Scene.load('hexapod_patches'), Scene.load('leg_wet_flat')


def test_rungs():
    assert fidelity.rung(HEXAPOD) == fidelity.rung(HEXAPOD, 'L1') == 'L1'
    assert fidelity.rung(LEG) == fidelity.rung(LEG, 'L0') == 'L0'
    with pytest.raises(InvalidInput, match=r"'L1': scene 'leg_wet_flat' has a rail_leg, which L0"):
        fidelity.rung(LEG, 'L1')
    with pytest.raises(InvalidInput, match='one of auto, L0, L1'):
        fidelity.rung(HEXAPOD, 'L9')


@pytest.mark.parametrize('scene, kind', [(HEXAPOD, PlanarHexapod), (LEG, RailLeg)])
def test_robots(scene, kind):
    robot = fidelity.build(scene, scene.floor.build(0), 0.004)
    assert isinstance(robot, kind)
    assert robot.legs == scene.legs
    assert len(robot.feet) == len(scene.legs)
    robot.step([0.0] * len(scene.legs))
    assert robot.time == pytest.approx(0.004)


@pytest.mark.parametrize(
    'name', [name for name in configuration.names('scenes') if not name.startswith('bench_')]
)
def test_what_is_left_out(name):
    terms = fidelity.omitted(Scene.load(name))
    assert len(terms) >= 2
    assert len({term.term for term in terms}) == len(terms)
    for term in terms:
        assert term.term and term.reason
        assert term.bound is None or 0.0 < term.bound < 1.0


def bound(scene, word):
    return next((t.bound for t in fidelity.omitted(scene) if word in t.term), None)


def test_bound_of_the_capillary_force():
    # By hand: 37 pads, 2 · 0.073 N/m · 3 mm each, against 0.35 · 6.834 N.
    assert bound(HEXAPOD, 'capillary') == pytest.approx(37 * 0.000438 / 2.392, rel=1e-3)

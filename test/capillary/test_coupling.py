# SPDX-License-Identifier: Apache-2.0
import functools
import math

import numpy as np
import pytest

from ros_pad.capillary.coupling import press_wet
from ros_pad.contact.dome import press
from ros_pad.contact.meniscus import WATER
from ros_pad.contact.pad import LARGE_PAD, Pad
from ros_pad.errors import NoSurface

# The quick tests of liquid are those of surfaces and meshes.
pytestmark = pytest.mark.slow

SIZE = LARGE_PAD.radius
# A pad so soft that the liquid deforms it visibly.
SOFT = Pad(SIZE, 0.4)


@functools.cache
def wet(pressure=75e3, force=0.1, stiffness=40.0, liquid=WATER):
    return press_wet(Pad(SIZE, stiffness), pressure, force, liquid)


@pytest.mark.slow
@pytest.mark.parametrize(('pressure', 'force'), [(75e3, 0.1), (60e3, 0.1), (85e3, 0.3)])
def test_the_rigid_pad_is_the_exact_membrane(pressure, force):
    """``press`` solves the same membrane with elliptic integrals, ``press_wet`` by shooting."""
    rigid = wet(pressure, force).rigid
    exact = press(LARGE_PAD, pressure, force, model='membrane')
    assert rigid.gap == pytest.approx(exact.gap, rel=1e-9)
    assert rigid.contact_radius == exact.contact_radius
    assert rigid.kink == 0.0 and rigid.rigid is None


SOFT_CASE = {'pressure': 750.0, 'force': 1e-3, 'stiffness': 0.4}


@pytest.mark.parametrize('case', [{}, SOFT_CASE], ids=['silicone', 'soft'])
def test_the_rim_carries_the_load(case):
    """Air pushes the base up and the membrane pulls its rim down; the rest is the load."""
    found = wet(**case)
    pressure, force = case.get('pressure', 75e3), case.get('force', 0.1)
    for pad in (found, found.rigid):
        down = 2.0 * math.pi * SIZE * pad.tension * math.sin(pad.rim_angle)
        assert pressure * math.pi * SIZE**2 - down == pytest.approx(force, rel=1e-8)
    disc = pressure * math.pi * found.contact_radius**2
    assert disc == pytest.approx(force + found.force, rel=1e-9)


@pytest.mark.parametrize('case', [{}, SOFT_CASE], ids=['silicone', 'soft'])
def test_three_tensions_close_at_the_contact_line(case):
    found = wet(**case)
    dry, liquid = found.tension, 0.073
    slack = dry - liquid * math.cos(WATER.angle)
    cosine = (dry**2 + slack**2 - liquid**2) / (2.0 * dry * slack)
    assert found.kink == pytest.approx(math.acos(cosine), rel=1e-5)


def changes(found):
    rigid = found.rigid
    names = ('gap', 'contact_radius', 'height', 'force')
    return np.array([getattr(found, name) / getattr(rigid, name) - 1.0 for name in names])


@pytest.mark.slow
def test_coupling_vanishes_as_the_inverse_of_stiffness():
    """Pressure and force grow with the stiffness, so that the dry pad keeps its profile."""
    twice, eight = (changes(wet(75e3 * k, 0.1 * k, 40.0 * k)) for k in (2.0, 8.0))
    assert np.all(abs(twice) > 1e-4)
    assert twice / eight == pytest.approx(4.0, rel=2e-2)


def test_liquid_presses_the_pad_down_and_a_soft_one_more():
    hard, soft = changes(wet()), changes(wet(**SOFT_CASE))
    assert hard[1] > 0.0 and soft[1] > 0.1  # the liquid draws the pad onto the floor
    assert np.all(abs(soft) > 30.0 * abs(hard))


def test_a_pad_too_soft_for_the_liquid_is_refused():
    with pytest.raises(NoSurface) as refusal:
        press_wet(Pad(SIZE, 0.04), 75.0, 1e-4, WATER)
    assert refusal.value.status == 'no_convergence'


def test_liquid_at_the_rim_is_refused():
    with pytest.raises(NoSurface, match='rim') as refusal:
        press_wet(LARGE_PAD, 40e3, 0.05, WATER)
    assert refusal.value.status == 'rim'

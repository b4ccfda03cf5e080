# SPDX-License-Identifier: Apache-2.0
import dataclasses
import math

import pytest

from ros_pad.contact import LARGE_PAD, SMALL_PAD, MeasuredLimit, Pad
from ros_pad.errors import InvalidInput


def test_the_thesis_pads():
    assert dataclasses.astuple(LARGE_PAD) == (1.5e-3, 40.0, 0.006, None, None, 0.4e-3)
    assert dataclasses.astuple(SMALL_PAD) == (0.5e-3, 7.0, 0.006, None, None, 0.2e-3)
    # Young's modulus times thickness, from the makers' moduli at 100 %, psi.
    assert SMALL_PAD.stiffness == pytest.approx(40.0 * (8 / 22) * (0.2 / 0.4), rel=0.05)


@pytest.mark.parametrize('field', ['radius', 'stiffness', 'adhesion_energy'])
@pytest.mark.parametrize('value', [-1.0, math.nan, math.inf, '1', None, True, [1.0, 2.0]])
def test_bad_values_name_the_field(field, value):
    with pytest.raises(InvalidInput, match=field):
        dataclasses.replace(LARGE_PAD, **{field: value})


@pytest.mark.parametrize(
    ('values', 'name'),
    [
        ((-0.1, 75e3, 1e-5), 'force'),
        ((0.3, 0.0, 1e-5), 'pressure'),
        ((0.3, 75e3, 0.0), 'slope'),
        ((0.3, 75e3, math.nan), 'slope'),
    ],
)
def test_a_measured_limit_rises(values, name):
    with pytest.raises(InvalidInput, match=f'{name} = .* is not allowed'):
        MeasuredLimit(*values)


def test_a_measured_limit_is_one():
    with pytest.raises(InvalidInput, match=r'measured_limit = 0\.3 is not allowed'):
        Pad(1e-3, 40.0, measured_limit=0.3)

# SPDX-License-Identifier: Apache-2.0
import dataclasses

import pytest

from ros_pad.contact import LARGE_PAD, SMALL_PAD, Pad
from ros_pad.errors import InvalidInput


def test_the_thesis_pads():
    assert dataclasses.astuple(LARGE_PAD) == (1.5e-3, 40.0, 0.006, None, None, 0.4e-3)
    assert dataclasses.astuple(SMALL_PAD) == (0.5e-3, 7.0, 0.006, None, None, 0.2e-3)
    # Young's modulus times thickness, from the makers' moduli at 100 %, psi.
    assert SMALL_PAD.stiffness == pytest.approx(40.0 * (8 / 22) * (0.2 / 0.4), rel=0.05)


def test_a_measured_limit_is_one():
    with pytest.raises(InvalidInput, match=r'measured_limit = 0\.3 is not allowed'):
        Pad(1e-3, 40.0, measured_limit=0.3)

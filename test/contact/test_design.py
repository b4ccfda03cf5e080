# SPDX-License-Identifier: Apache-2.0
import math

import mpmath
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ros_pad.contact import (
    LARGE_PAD,
    Liquid,
    Pad,
    design,
    design_pressure,
    foot_force,
    force_limit,
    inflate,
    pads_in,
    pressure_for,
    rise_height,
)
from ros_pad.errors import InvalidInput, NoEquilibrium

READINGS = ('corrected', 'thesis')
SOLE = math.pi * 0.017**2


def rise_by_polynomial(radius_mm: float, reading: str) -> list[float]:
    """Return all heights, mm, that satisfy equation 3.101: roots of its square at 30 digits."""
    with mpmath.workdps(30):
        r = mpmath.mpf(radius_mm)
        lift = 2 * mpmath.mpf('0.073') / 2 / (1000 * mpmath.mpf('9.81')) * 10**6  # mm²
        if reading == 'corrected':
            share = 9 * mpmath.sqrt(3) / 2 / mpmath.pi
            # lift √((3r − h) h) = h g(h), g = share r² − 1.5 r h + h²/3
            g = [mpmath.mpf(1) / 3, -1.5 * r, share * r * r]
        else:
            share = (mpmath.pi / 3 + mpmath.sqrt(3)) / mpmath.pi
            g = [mpmath.mpf(1) / 3, share * r * r - 1.5 * r]
        square = [mpmath.mpf(0)] * (2 * len(g))
        for i, first in enumerate(g):
            for j, second in enumerate(g):
                square[i + j] += first * second
        square[-2] += lift**2
        square[-1] -= 3 * lift**2 * r
        roots = mpmath.polyroots(square, maxsteps=500, extraprec=200)
        return [
            float(root.real)
            for root in roots
            if abs(root.imag) < 1e-15
            and 0 < root.real <= 3 * r
            and mpmath.polyval(g, root.real) >= 0
        ]


def test_coefficients_of_both_readings():
    s = LARGE_PAD.stiffness * 1e-3 / LARGE_PAD.radius
    assert foot_force(1e-3, 1.5e-3, 40.0) / s == pytest.approx(1.721779607181829, rel=1e-14)
    assert foot_force(1e-3, 1.5e-3, 40.0, 'thesis') / s == pytest.approx(4.860612, rel=1e-6)
    assert design_pressure(2.0, 3.0) == pytest.approx(1.5 * 4.27170082044296, rel=1e-14)
    assert design_pressure(2.0, 3.0, 'thesis') == pytest.approx(1.5 * 4.3, rel=1e-15)
    assert pads_in(7.7942, 1.0) == pytest.approx(1.0, rel=4e-6)
    assert pads_in(2.7792, 1.0, 'thesis') == pytest.approx(1.0, rel=2e-5)
    assert pads_in(1.0, 1.0, 'thesis') / pads_in(1.0, 1.0) == pytest.approx(2.8044, rel=3e-5)


def test_the_design_pressure_inflates_to_one_and_a_half_radii():
    for pad in (LARGE_PAD, Pad(0.7e-3, 25.0)):
        dome = inflate(pad, design_pressure(pad.radius, pad.stiffness))
        assert dome.sphere_radius == pytest.approx(1.5 * pad.radius, rel=1e-13)
        assert dome.height > pad.radius  # more than a half sphere: it overhangs


def test_the_corrected_cell_is_that_of_spheres_which_touch():
    # Count the centres of a hexagonal pattern of pitch 3 r in a large square.
    r, side = 1e-3, 1.0
    rows = math.floor(side / (3 * r * math.sqrt(3) / 2))
    counted = rows * math.floor(side / (3 * r))
    assert pads_in(side**2, r) == pytest.approx(counted, rel=4e-3)
    # The printed cell is smaller than the cell of touching flat pads.
    assert pads_in(1.0, r, 'thesis') * 2 * math.sqrt(3) * r * r > 1.24


@pytest.mark.parametrize('reading', READINGS)
@pytest.mark.parametrize(
    'radius', [0.05, 0.3, 0.5, 0.566, 0.57, 0.8, 1.0, 1.5, 2.0, 2.35, 2.5, 2.9, 3.0, 5.0, 20.0]
)
def test_rise_is_the_only_root_of_3_101(radius, reading):
    roots = rise_by_polynomial(radius, reading)
    if reading == 'thesis' and radius < 0.5652:
        assert roots == []
        with pytest.raises(NoEquilibrium, match=r'0\.000565187 m') as caught:
            rise_height(radius * 1e-3, reading=reading)
        assert caught.value.status == 'no_rise'
        return
    assert len(roots) == 1
    assert rise_height(radius * 1e-3, reading=reading) == pytest.approx(roots[0] * 1e-3, rel=1e-12)


def test_rise_has_its_maximum_far_from_the_claimed_optimum():
    r = np.linspace(0.3e-3, 4e-3, 3701)
    height = rise_height(r)
    assert r[height.argmax()] == pytest.approx(2.33e-3, abs=0.02e-3)
    assert height.max() == pytest.approx(5.235e-3, abs=0.002e-3)
    claimed = r <= 0.8e-3
    assert (height[claimed] > 0.99 * 3 * r[claimed]).all()  # the gaps are full
    assert (np.diff(height[claimed]) > 0).all()  # and there is no optimum
    typed = rise_height(r, reading='thesis')
    assert np.isnan(typed[r < 0.565e-3]).all()
    assert np.isfinite(typed[r > 0.566e-3]).all()
    assert r[np.nanargmax(typed)] == pytest.approx(2.675e-3, abs=0.01e-3)


@given(
    st.floats(1e-6, 0.1), st.floats(1e-3, 1.0), st.floats(0.0, 1.57), st.floats(500.0, 2e4),
    st.floats(7.8, 1e3),
)  # fmt: skip
def test_rise_balances_the_weight(radius, tension, angle, density, cell):
    liquid = Liquid(tension, tension / 2, density, angle)
    h = rise_height(radius, liquid, cell=cell)
    assert 0 < h <= 3 * radius
    # The liquid between the domes is weighed in slices and hangs from the circle where it ends.
    z, weights = np.polynomial.legendre.leggauss(3)
    z = 0.5 * h * (z + 1.0)
    slices = cell * radius**2 - math.pi * z * (3 * radius - z)
    weight = density * 9.81 * 0.5 * h * np.sum(weights * slices)
    lift = tension * math.cos(angle)
    # Near full gaps the circle's radius is a small difference: allow for rounding of h.
    wet = [math.sqrt(max(3 * radius - each, 0.0) * each) for each in (h * (1 - 1e-14), h)]
    pull = [2 * math.pi * lift * each for each in wet]
    slack = 1e-10 * weight + abs(pull[0] - pull[1])
    assert pull[1] - slack <= weight <= pull[0] + slack


def test_rise_of_larger_cells_is_lower_and_smaller_cells_are_refused():
    assert rise_height(1.5e-3, cell=10.0) < rise_height(1.5e-3)
    assert rise_height(1.5e-3, cell=2 * math.sqrt(3) * 2.25) == rise_height(1.5e-3)
    with pytest.raises(InvalidInput, match=r'cell = 7\.0 '):
        rise_height(1.5e-3, cell=7.0)
    with pytest.raises(InvalidInput, match='thesis'):
        rise_height(1.5e-3, reading='thesis', cell=10.0)


def test_rise_needs_a_liquid_that_wets():
    for angle in (math.pi / 2, 2.0):
        with pytest.raises(InvalidInput, match='contact_angle'):
            rise_height(1e-3, Liquid(0.073, 0.03, contact_angle=angle))
    almost = Liquid(0.073, 0.03, contact_angle=math.pi / 2 - 1e-9)
    # For a small rise h, lift balances weight: L √(3 r h) = (cell/π) r² h, with
    # L = 2 γ cos θ/(ρ g).
    drawn = 2 * 0.073 * math.cos(almost.angle) / (1000 * 9.81)
    expected = 3e-3 * (drawn / (2.480980029398064 * 1e-6)) ** 2
    assert rise_height(1e-3, almost) == pytest.approx(expected, rel=1e-6)
    with pytest.raises(InvalidInput, match='liquid'):
        rise_height(1e-3, 0.073)


def test_shapes_broadcast_and_scalars_are_floats():
    r = np.array([0.5e-3, 1.5e-3])
    area = np.array([[1e-3], [2e-3], [3e-3]])
    for reading in READINGS:
        assert pads_in(area, r, reading).shape == (3, 2)
        assert foot_force(area, r, 40.0, reading).shape == (3, 2)
        assert foot_force(1e-3, 1e-3, r, reading).shape == (2,)
        assert rise_height(r, reading=reading).shape == (2,)
        assert rise_height(r[1:], reading=reading)[0] == rise_height(1.5e-3, reading=reading)
        for value in (
            pads_in(1e-3, 1e-3, reading),
            foot_force(1e-3, 1e-3, 40.0, reading),
            design_pressure(1e-3, 40.0, reading),
            rise_height(1e-3, reading=reading),
        ):
            assert type(value) is float
    assert design_pressure(r, np.array([[30.0], [40.0]])).shape == (2, 2)
    assert pads_in(0.0, 1e-3) == 0.0


@pytest.mark.parametrize('value', [-1.0, 0.0, math.nan, math.inf, 'x', None])
def test_bad_numbers(value):
    for call in (
        lambda: pads_in(1e-3, value),
        lambda: foot_force(1e-3, value, 40.0),
        lambda: design_pressure(value, 40.0),
        lambda: rise_height(value),
    ):
        with pytest.raises(InvalidInput, match='radius'):
            call()
    for key in ('load', 'area', 'ceiling', 'margin'):
        with pytest.raises(InvalidInput, match=key):
            design(**{'load': 7.0, 'area': SOLE} | {key: value})
    with pytest.raises(InvalidInput, match='stiffness'):
        foot_force(1e-3, 1e-3, value)


def test_bad_words_and_shapes():
    for call in (
        lambda: pads_in(1e-3, 1e-3, 'printed'),
        lambda: foot_force(1e-3, 1e-3, 40.0, 'printed'),
        lambda: design_pressure(1e-3, 40.0, 'printed'),
        lambda: rise_height(1e-3, reading='printed'),
        lambda: design(7.0, SOLE, reading='printed'),
        lambda: design(7.0, SOLE, pads=37, reading='printed'),
    ):
        with pytest.raises(InvalidInput, match='corrected, thesis'):
            call()
    with pytest.raises(InvalidInput, match='broadcast'):
        pads_in([1e-3, 2e-3], [1e-3, 1e-3, 1e-3])
    with pytest.raises(InvalidInput, match='broadcast'):
        foot_force([1e-3, 2e-3], [1e-3, 1e-3, 1e-3], 40.0)


@pytest.mark.parametrize('reading', READINGS)
@pytest.mark.parametrize('criterion', ['thickness', 'measured', 'flattening', 'max_depth'])
def test_a_design_adds_up(reading, criterion):
    sole = design(7.0, SOLE, criterion=criterion, reading=reading, margin=1.5)
    assert sole.pads == math.floor(pads_in(SOLE, LARGE_PAD.radius, reading))
    assert sole.load_per_pad * sole.pads == pytest.approx(7.0)
    assert force_limit(LARGE_PAD, sole.pressure, criterion) == pytest.approx(
        1.5 * sole.load_per_pad, rel=1e-10
    )
    reach = sole.pads * force_limit(LARGE_PAD, 90e3, criterion) / 1.5
    assert sole.reachable_load == pytest.approx(reach)
    assert sole.pitch**2 * math.sqrt(3) / 2 * sole.pads == pytest.approx(SOLE)
    assert sole.carried
    assert sole.touching == (reading == 'thesis')


@given(st.floats(0.1, 60.0), st.floats(0.3e-3, 4e-3), st.floats(30e3, 91e3), st.floats(0.5, 3.0))
def test_carried_means_within_reach(load, radius, ceiling, margin):
    sole = design(load, SOLE, Pad(radius, 40.0), ceiling=ceiling, margin=margin)
    if abs(sole.reachable_load / load - 1) > 1e-9:
        assert sole.carried == (load < sole.reachable_load)
    if math.isfinite(sole.pads_needed):
        assert sole.pads_needed * sole.pad_limit >= load * margin * (1 - 1e-12)
        assert (sole.pads_needed - 1) * sole.pad_limit < load * margin
    else:
        assert sole.reachable_load == 0
    assert sole.ceiling <= ceiling


def test_what_is_asked_beyond_the_model_is_not_carried():
    heavy = design(100.0, SOLE)
    assert not heavy.carried
    assert math.isnan(heavy.pressure)
    # If the needed pressure is above the ceiling, the design still has it.
    low = design(7.0, SOLE, ceiling=50e3)
    assert not low.carried
    assert low.pressure == pressure_for(LARGE_PAD, 7.0 / low.pads, margin=1.2)
    # The model of larger pads ends below the default ceiling.
    large = design(7.0, SOLE, Pad(2.5e-3, 40.0))
    assert large.ceiling == pytest.approx(3.426 * 40.0 / 2.5e-3, rel=1e-3)
    assert not large.carried
    # A higher ceiling does not extend the line through the measurements.
    measured = design(7.0, SOLE, ceiling=200e3, criterion='measured')
    assert measured.ceiling <= 91.36e3
    free = design(7.0, SOLE, Pad(1e-3, 40.0), ceiling=120e3, criterion='max_depth')
    assert free.ceiling == 120e3


def test_pads_as_built():
    built = design(7.0, SOLE, pads=37)
    assert built.pads == 37
    assert built.pitch > design(7.0, SOLE).pitch
    assert built.rise_height < rise_height(1.5e-3)
    packed = design(7.0, SOLE, pads=60)
    assert math.isnan(packed.rise_height)  # 60 domes with spheres of 1.5 radii do not fit
    assert not packed.touching  # but domes at this pressure do fit
    assert packed.pads_without_touching >= 60
    for pads in (0, -3, 129, 2.0, True, '37'):
        with pytest.raises(InvalidInput, match='from 1 to 128'):
            design(7.0, SOLE, pads=pads)


def test_whole_cells_are_all_counted():
    for pads in range(1, 200):
        area = pads * 4.5 * math.sqrt(3.0) * 1.5e-3**2
        assert design(1.0, area).pads == pads
    with pytest.raises(InvalidInput, match='area'):
        design(1.0, 17e-6)


def test_width_of_the_domes():
    # Low domes are widest at the rim, tall ones at the equator.
    assert design(0.1, SOLE, ceiling=50e3, criterion='max_depth').dome_width == 3e-3
    tall = design(18.0, SOLE)
    assert tall.pressure > 80e3
    assert tall.dome_width == 2 * inflate(LARGE_PAD, tall.pressure).sphere_radius
    beyond = design(100.0, SOLE)
    assert beyond.dome_width == 2 * inflate(LARGE_PAD, 90e3).sphere_radius


def test_how_far_the_printed_force_is_from_what_was_measured():
    # The printed force of a pad pressed flat is 1.5 to 3 times what a pad carried when measured.
    for pressure, measured, factor in [(65e3, 0.15, 3.06), (75e3, 0.30, 1.77), (85e3, 0.40, 1.50)]:
        flat = design(1.0, SOLE, pads=1, ceiling=pressure).flat_force
        assert flat / measured == pytest.approx(factor, abs=0.01)
    # The design pressure is also beyond the model of the pressed dome.
    with pytest.raises(NoEquilibrium):
        force_limit(LARGE_PAD, design_pressure(1.5e-3, 40.0), 'flattening')


def test_pads_may_be_a_number_of_numpy():
    sole = design(7.0, SOLE, pads=np.int64(37))
    assert sole == design(7.0, SOLE, pads=37)
    assert type(sole.pads) is int


@pytest.mark.parametrize(('area', 'radius'), [(1e-3, 1e-200), (1e-3, 1e-320), (1e305, 1e-3)])
def test_pads_that_nobody_can_count(area, radius):
    with pytest.raises(InvalidInput, match=r'radius = .* is not allowed on an area of'):
        design(7.0, area, Pad(radius, 40.0))

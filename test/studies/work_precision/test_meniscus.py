# SPDX-License-Identifier: Apache-2.0
import json
import math
import pathlib

import pytest

from ros_pad.contact import Liquid, bridge
from ros_pad.errors import NoBridge
from studies.work_precision import comparison, meniscus

pytestmark = pytest.mark.slow

REFERENCE = pathlib.Path(__file__).parents[2] / 'reference'


@pytest.fixture(scope='module')
def results():
    """Measure on a part of the sample, once and briefly."""
    shares = []
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(comparison, 'REPEATS', 1)
        patch.setattr(comparison, 'TIMED', 0.01)
        patch.setattr(meniscus, 'ORDINARY', meniscus.ORDINARY[::12])
        patch.setattr(meniscus, 'CORNERS', meniscus.CORNERS[::4])
        patch.setattr(meniscus, 'PRESSURES', (75e3,))
        patch.setattr(meniscus, 'SHARES', meniscus.SHARES[1::3])
        measured = meniscus.measure(shares.append)
    assert shares == sorted(shares)
    assert shares[-1] == pytest.approx(1.0)
    return {(result.problem, result.method): result for result in measured}


def test_truth_of_the_bridge_is_that_of_the_reference_table():
    for row in json.loads((REFERENCE / 'sphere_plane_bridge.json').read_text())['rows']:
        found = meniscus.followed(math.radians(row['theta']), math.radians(row['beta']), 0.0)
        assert found.force / (4 * math.pi) == pytest.approx(row['F_quad'], abs=1e-12)
        assert found.pressure == pytest.approx(row['dpR_over_gamma'], rel=1e-10)


@pytest.mark.parametrize(('bond', 'share'), [(0.0, 1), (0.5, 3), (5.0, 5)])
def test_corners_are_on_the_branch_that_begins_with_a_narrow_gap(bond, share):
    """Bridges of ``bridge`` are the same as those on the branch that is followed."""
    for theta, beta, gap in meniscus.CORNERS[::share]:
        angles = math.radians(theta), math.radians(beta)
        truth = meniscus.followed(*angles, gap, bond)
        known = {'separation': gap, 'gravity': bond, 'density': 1.0, 'method': 'young_laplace'}
        if truth is None:
            with pytest.raises(NoBridge):
                bridge(1.0, 1.0, angles[0], filling_angle=angles[1], **known)
            continue
        found = bridge(1.0, 1.0, angles[0], filling_angle=angles[1], **known)
        assert found.force == pytest.approx(truth.force, rel=1e-10)
        assert found.volume == pytest.approx(truth.volume, rel=1e-10)


# Surface tension, N/m; solid over surface tension; height, m, computed outside of ros_pad for a
# sphere of 1.55 mm on a contact of 0.583 mm.
@pytest.mark.parametrize(
    ('surface', 'ratio', 'height'),
    [
        (0.0016, 0.25, 0.00028043669898361275),
        (0.002, 0.9, 0.0005898354741563928),
        (0.0073, 0.5, 0.0006291970623879248),
        (0.073, 0.25, 0.0007230955757094082),
        (0.073, 0.8, 0.0014177962147687345),
    ],
)
def test_truth_of_the_ring(surface, ratio, height):
    liquid = Liquid(surface, ratio * surface)
    assert meniscus.bath(0.583e-3, 1.55e-3, 1e-11, liquid) == pytest.approx(height, rel=1e-9)


def test_exact_methods_are_exact_and_never_fail(results):
    exact = [
        result
        for (_, method), result in results.items()
        if method in ('exact', 'exact, by volume')
    ]
    assert len(exact) == 4
    for result in exact:
        assert result.failures == 0
        assert result.error < 1e-10
    for problem in {result.problem for result in exact}:
        assert results[problem, meniscus.SHOOTING].error < 1e-6

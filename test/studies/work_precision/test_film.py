# SPDX-License-Identifier: Apache-2.0
import json
import math
from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest

from studies import command
from studies.work_precision import film


@pytest.fixture(scope='module')
def document():
    return json.loads((command.CHARTS / 'film.json').read_text(encoding='utf-8'))


def test_histories_beside_the_reference():
    """The film of walks is nearer than rigid discs, in points of dry share."""
    rows = film.histories()
    off = {
        key: np.concatenate([np.subtract(row[key], row['dry_share']) for row in rows])
        for key in ('reduced', 'rigid')
    }
    assert np.sqrt(np.mean(off['reduced'] ** 2)) < 0.03 < 0.3 < np.sqrt(np.mean(off['rigid'] ** 2))


def test_kept_costs_of_films(document):
    """Shorter steps and more rings are nearer to the reference; rigid discs are far from it."""
    errors = {row['film']: row['rms'] for row in document['costs']}
    assert errors['film of walks, 1 ms'] < 0.03 < errors['film of walks, 4 ms']
    assert errors['100 rings'] < errors['50 rings'] < errors['25 rings'] < 0.15
    assert errors['rigid discs, 1 ms'] > 0.3


def test_kept_figures_have_the_closed_forms(document):
    """Stefan after 1 s and 3 s; lens of uniform pressure, (16/3 - 4)/π p a/E*."""
    for row in document['soles']:
        rigid = [
            (3e-4**-2 + 4.0 * 0.3 * time / (3e-3 * math.pi * 1.5e-3**4)) ** -0.5
            for time in (1.0, 3.0)
        ]
        assert row['rigid_m'] == pytest.approx(rigid, rel=1e-9)
        lens = (16.0 / 3.0 - 4.0) * 0.3 / (math.pi**2 * 1.5e-3 * row['modulus_pa'])
        assert row['lens_mean_m'] == pytest.approx(lens, rel=1e-9)
        assert all(
            min(lens, 2.9e-4) * 0.999 < mean < lens + film
            for mean, film in zip(row['mean_m'], rigid, strict=True)
        )


def test_kept_errors_fall_with_rings(document):
    rows = {(row['problem'], row['method']): row['error'] for row in document['rows']}
    for problem in {name for name, _ in rows}:
        errors = [rows[problem, f'{rings} rings'] for rings in (25, 50, 100, 200)]
        assert all(b < 0.4 * a for a, b in pairwise(errors))
        assert rows[problem, 'Stefan-Reynolds'] > 0.9


def test_dry_share_by_hand(document):
    """A rigid film of 0.199 µm on a critical one of 0.5 µm: exp(−(h/h_c)²) = 0.853."""
    even = SimpleNamespace(
        radius=np.array([1e-3, 3e-3]), area=np.ones(2), thickness=np.array([[1.99e-7, 1.0]])
    )
    assert film.dry_shares(even, 2e-3) == pytest.approx([math.exp(-(0.398**2))])
    assert document['soles'][-1]['rigid_dry'][0] == pytest.approx(0.853, abs=2e-3)


def test_rise_of_a_load_by_hand():
    """A ramp of 20 ms to 8 N, and a jump to half of it that reaches the rest 0.1 s later."""
    time = np.arange(0.0, 0.4, 1e-3)
    ramp = np.minimum(time / 0.02, 1.0) * 8.0
    jump = np.where(time < 0.1, 4.0, 8.0)
    off, bounce = np.zeros(100), np.array([5.0, 0.0, 0.0])
    short = np.full(150, 8.0)  # no whole stance
    force = np.concatenate([jump, off, ramp, off, short, off, bounce, jump, off, ramp])
    found = film.rise_times(force, 1e-3)
    assert found[0] == pytest.approx((8e-3, 16e-3), abs=1e-9)
    # From 0 to 5 N in one sample: 10 and 50 % are within it. Of 8 N, 90 % is between 4 and 8 N.
    assert found[1] == pytest.approx((0.64e-3, 103e-3 - 0.16e-3 + 0.8e-3), abs=1e-9)
    assert len(found) == 2  # the first and the last stance are cut off

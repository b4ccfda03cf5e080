# SPDX-License-Identifier: Apache-2.0
import json
import math
from itertools import pairwise

import pytest

from ros_pad.contact.squeeze import STIFF
from studies import command
from studies.work_precision import film


@pytest.fixture(scope='module')
def document():
    return json.loads((command.CHARTS / 'film.json').read_text(encoding='utf-8'))


def test_the_rule_separates_rigid_from_soft_films():
    rows = film.rule(rings=25)
    stiff = [row['excess'] for row in rows if row['dimple_over_film'] <= STIFF]
    soft = [row['excess'] for row in rows if row['dimple_over_film'] >= 2.0 * STIFF]
    assert len(stiff) > 5 and len(soft) > 5
    assert max(stiff) < 0.1 < min(soft)
    # The rigid film and the mean dimple together are more than the soft film.
    assert all(0.0 < row['excess'] < row['dimple_over_film'] for row in rows)


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


def test_films_of_the_thesis_pad():
    flat = film.sole(3.95e5, [1.0], 40)
    assert flat.dry_share(film.CRITICAL)[0] < 0.02
    domed = film.dome(0.19, [1.0], 40)
    assert domed.radius[domed.thickness[0].argmin()] == pytest.approx(film.contact(0.19), rel=0.02)

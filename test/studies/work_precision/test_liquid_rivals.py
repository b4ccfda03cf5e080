# SPDX-License-Identifier: Apache-2.0
import argparse
import math
import re

import numpy as np
import pytest
from scipy.integrate import quad

from ros_pad.errors import ConfigError
from studies import command
from studies.__main__ import main
from studies.work_precision import evolver, liquid_rivals

DOME = evolver.Solid.dome(1.55, 0.583)
CONE = evolver.Solid.cone(1.6, -0.364)
DOCS = command.ROOT / 'docs'


def value(formula, **at):
    """Return the value of a formula of Evolver; an equation is its left side less its right."""
    words = formula.replace('^', '**')
    if '=' in words:
        words = '{} - ({})'.format(*words.split('='))
    return eval(words, {'sqrt': math.sqrt, **at})


@pytest.mark.parametrize('solid', [DOME, CONE], ids=['dome', 'cone'])
def test_line_integrals_are_those_of_the_wall(solid):
    assert value(solid.formula, x=0.6 * solid.radius(0.9), y=0.8 * solid.radius(0.9), z=0.9) == (
        pytest.approx(0.0, abs=1e-12)
    )

    def slope(z):
        return (solid.radius(z + 1e-6) - solid.radius(z - 1e-6)) / 2e-6

    area = quad(lambda z: solid.radius(z) * math.hypot(1.0, slope(z)), 0.0, 0.9)[0]
    raised = quad(lambda z: z * solid.radius(z) * slope(z), 0.0, 0.9)[0]
    moment = quad(lambda z: 0.5 * z**2 * solid.radius(z) * slope(z), 0.0, 0.9)[0]
    found = [value(each, z=0.9) for each in (solid.wet, solid.raised, solid.moment)]
    assert found == pytest.approx([area, raised, moment], rel=1e-8)


@pytest.mark.parametrize('whole', [False, True])
@pytest.mark.parametrize('sides', [4, 6, 0])
def test_a_first_surface_fills_the_cell_round_the_pad(sides, whole):
    task = evolver.Task(DOME, 1.0, 0.134, 0.8, 3.0, sides, whole)
    text = '\n'.join(evolver.datafile(task))
    formulas = dict(re.findall(r'constraint (\d+)\nformula: (.*)', text))
    vertices, edges, faces = (
        [line.split()[1:] for line in part.strip().splitlines()]
        for part in re.split(r'\n(?:vertices|edges|faces)\n', text)[1:]
    )
    points = np.array([row[:3] for row in vertices], dtype=float)
    for row, (x, y, z) in zip(vertices, points, strict=True):
        for number in row[4:]:
            assert value(formulas[number], x=x, y=y, z=z) == pytest.approx(0.0, abs=1e-9)
    plan = 0.0
    for face in faces:
        ends = [(edges[abs(int(k)) - 1][:2])[:: 1 if int(k) > 0 else -1] for k in face]
        assert [end for _, end in ends] == [start for start, _ in (*ends[1:], ends[0])]
        a, b, c = (points[int(start) - 1, :2] for start, _ in ends)
        area = 0.5 * ((b - a)[0] * (c - a)[1] - (b - a)[1] * (c - a)[0])
        assert area > 0.0  # the normal points upwards
        plan += area
    outer = {4: 4.0, 6: 12.0 * math.tan(math.pi / 6), 0: 24.0 * math.sin(math.pi / 12) / 2.0}
    inner = 24.0 * math.sin(math.pi / 12) / 2.0 * DOME.radius(0.8) ** 2
    cell = outer[sides] * 9.0 if sides != 6 else 6.0 * 9.0 * math.tan(math.pi / 6)
    assert plan == pytest.approx((cell - inner) * task.turn / (2.0 * math.pi), rel=1e-9)
    on_pad = [row for row in edges if 'wall' in row]
    assert len(on_pad) == round(24 * task.turn / (2.0 * math.pi))


def test_what_evolver_prints_is_that_of_the_whole_cell(tmp_path):
    program = tmp_path / 'evolver'
    task = evolver.Task(DOME, 1.0, 0.134, 0.8, 3.0)
    for last, good in (('1e-12', True), ('1e-3', False), ('nan', False)):
        program.write_text(f'#!/bin/sh\ncat > /dev/null\necho FOUND 8 0.5 2.0 -3.0 {last}\n')
        program.chmod(0o700)
        if not good:
            with pytest.raises(ConfigError, match='has found no surface: FOUND 8'):
                evolver.solve(program, task, 0)
            continue
        found = evolver.solve(program, task, 0)
        assert (found.facets, found.volume, found.energy) == (8, 24.0, -36.0)
        assert found.height == pytest.approx(0.5 / (math.pi / 6))
    with pytest.raises(ConfigError, match=r'--evolver .*none'):
        evolver.solve(tmp_path / 'none', task, 0)


def test_bridges_are_those_of_quadrature():
    necks = liquid_rivals.bridges()
    exact, circle = liquid_rivals.our_bridges(necks[::4])
    assert max(worst for _, worst in exact.errors.values()) < 1e-9
    assert 1e-3 < circle.errors['force'][0] < 0.1


def test_yade_is_read_though_it_is_for_python_2(tmp_path):
    path = tmp_path / 'solve.py'
    path.write_text(
        'def solveLiqBridge(*given):\n'
        "    print 'Computed', given[4]\n"
        '    return 0.3, 1.1, 0.5, 0, 0, 0, 0, 0, given[4] < 1e-3\n'
    )
    neck = liquid_rivals.Neck(0.0, 20.0, 1.0, 0.2, 1.0, 0.6, slope=-2.0)
    rows = liquid_rivals.yade_bridges(liquid_rivals.load_yade(str(path)), [neck])
    assert [row.cases for row in rows] == [1, 1]  # the coarsest has missed its neck
    # Its 0.5 is the force at 0.3, where the true one is 0.6 - 0.1 · 2.
    assert rows[0].errors['force'] == pytest.approx((1.0 / 6.0, 1.0 / 6.0))
    assert rows[0].errors['volume'] == pytest.approx((0.1, 0.1))


@pytest.mark.parametrize('text', ['', 'def other(): pass', 'x', 'a b'])
def test_another_file_than_that_of_yade_is_refused(tmp_path, text):
    path = tmp_path / 'solve.py'
    path.write_text(text)
    with pytest.raises(ConfigError, match='no function solveLiqBridge there'):
        liquid_rivals.load_yade(str(path))


@pytest.mark.parametrize(
    ('words', 'says'),
    [
        (('capillary', '--evolver', 'none'), '--evolver: none: no such program'),
        (('capillary', '--yade', 'none'), '--yade: none: no such file'),
        (('limit_surface', '--rival', 'none'), '--rival: none: no such file'),
        (('labelled_pce', 'none'), 'FOLDER: none: no such file'),
    ],
)
def test_a_missing_rival_is_found_before_anything_is_measured(words, says, capsys):
    with pytest.raises(SystemExit, match='2'):
        main(words)
    assert says in capsys.readouterr().err


def test_without_rivals_their_stored_rows_are_kept_and_ours_measured(monkeypatch, capsys):
    monkeypatch.setattr(liquid_rivals, 'SIZES', ((24, 1),))
    options = argparse.Namespace(evolver=None, yade=None, arrays=1)
    rows = liquid_rivals.measure(options, lambda share: None)
    assert 'without --yade its rows are those of capillary.json' in capsys.readouterr().err
    kept = liquid_rivals.stored(DOCS / 'charts' / 'capillary.json')
    ours = (liquid_rivals.OURS, liquid_rivals.LEVEL, liquid_rivals.EXACT, liquid_rivals.CIRCLE)
    theirs = [
        sorted(
            repr(row)
            for row in each
            if getattr(row, 'method', '') not in ours and getattr(row, 'family', '') != 'minimised'
        )
        for each in (rows, kept)
    ]
    assert theirs[0] == theirs[1] and len(theirs[0]) > 20
    (found,) = [row for row in rows if getattr(row, 'method', '') == liquid_rivals.OURS]
    assert found.cases == 1
    assert max(worst for _, worst in found.errors.values()) < 0.01
    assert len(liquid_rivals.figures(rows)['capillary_rivals'].axes) == 6


def test_arrays_that_are_asked_of_evolver_are_in_turn_hexagonal_and_square():
    arrays = [
        row
        for row in liquid_rivals.stored(DOCS / 'charts' / 'capillary.json')
        if isinstance(row, liquid_rivals.Array)
    ]
    assert len(arrays) == len(liquid_rivals.PITCHES) * len(liquid_rivals.LIQUIDS)
    assert [array.sides for array in arrays[:2]] == [6, 4]
    assert max(max(array.own.values()) for array in arrays) < 2e-3
    for array in arrays:
        weight = 1000.0 * 9.81 * array.exact['volume']
        assert array.exact['force'] == pytest.approx(weight)

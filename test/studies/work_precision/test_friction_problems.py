# SPDX-License-Identifier: Apache-2.0
"""The study friction_problems: files of others, and contacts whose solution is known."""

import json
from dataclasses import replace

import numpy as np
import pytest

from ros_pad.errors import InvalidInput
from studies.__main__ import main
from studies.work_precision import friction_problems as study

BLOCK = '3\n1\n0\n3\n3\n3\t3\n1 0 0\n0 2 0.5\n0 0.25 3\n-0.1 0.4 0.3\n0.5 \n1\n'


def block(push, friction):
    """Return a point mass of 1 kg on a floor, pressed with 0.1 N s and sliding at a speed."""
    return study.Problem.of('block', np.eye(3), [-0.1, *push], [friction])


def test_siconos_text_has_its_matrix_by_columns(tmp_path):
    (tmp_path / 'Rover1.dat').write_text(BLOCK)
    problem = study.found([tmp_path])[0]
    assert problem.compliance[2, 1] == pytest.approx(0.25)  # the mean of the diagonal is 2
    assert problem.compliance[1, 2] == pytest.approx(0.125)
    assert problem.free == pytest.approx([-0.1, 0.4, 0.3])
    assert problem.friction == pytest.approx([0.5])


def test_arrays_of_contactbench_have_their_normal_last(tmp_path):
    matrix = np.diag([1.0, 2.0, 3.0])
    np.savez(tmp_path / '2cubes_t0.npz', G=matrix, g=[[4.0], [5.0], [6.0]], mus=[0.9])
    problem = study.found([tmp_path])[0]
    assert np.diag(problem.compliance) == pytest.approx([1.5, 0.5, 1.0])
    assert problem.free == pytest.approx([6.0, 4.0, 5.0])


def test_compressed_files_are_by_columns_or_by_rows(tmp_path):
    h5py = pytest.importorskip('h5py')
    for kind, at in ((-1, (2, 0)), (-2, (0, 2))):
        path = tmp_path / f'Capsules{kind}.hdf5'
        with h5py.File(path, 'w') as file:
            local = file.create_group('fclib_local')
            for key, value in (('p', [0, 2, 3, 4]), ('i', [0, 2, 1, 2]), ('x', [3.0, 1, 3, 3])):
                local[f'W/{key}'] = value
            local['W/nz'] = [kind]
            local['vectors/q'], local['vectors/mu'] = [1.0, 0.0, 0.0], [0.7]
        assert study.read(path).compliance[at] == pytest.approx(1.0 / 3.0)


@pytest.mark.parametrize(
    ('name', 'text', 'says'),
    [
        ('Rover1.dat', '2\n1\n0\n3', 'dimension 2'),
        ('Rover1.dat', BLOCK[:40], 'no contact problem'),
        ('Rover1.txt', BLOCK, r'must be one of .dat, .hdf5, .npz'),
    ],
)
def test_what_is_no_problem_is_refused(tmp_path, name, text, says):
    (tmp_path / name).write_text(text)
    with pytest.raises(InvalidInput, match=says):
        study.found([tmp_path / name])


def test_an_empty_folder_names_the_files_looked_for(tmp_path, capsys):
    assert main(['friction_problems', str(tmp_path)]) == 2
    assert 'Rover*.dat' in capsys.readouterr().err


def test_a_python_without_siconos_is_refused(tmp_path):
    python = tmp_path / 'python'
    python.write_text('#!/bin/sh\necho "No module named siconos" >&2\nexit 1\n')
    python.chmod(0o755)
    with pytest.raises(InvalidInput, match='install python3-siconos'):
        study.by_siconos([block((0.0, 0.0), 0.5)], str(python), 1)


def test_points_move_to_the_nearest_point_of_the_cone():
    """With μ = 1 the cone is at 45°: inside, below its polar, and beside it."""
    points = np.array([[1.0, 0.5, 0.0], [-1.0, 0.0, 0.9], [0.0, 0.0, 2.0]])
    expected = [[1.0, 0.5, 0.0], [0.0, 0.0, 0.0], [1.0, 0.0, 1.0]]
    assert study.in_cones(points, np.ones(3)) == pytest.approx(np.array(expected))


@pytest.mark.parametrize(
    ('speed', 'expected'),
    # It stops if μ times the impulse of 0.1 N s holds it; else it is braked by 0.05 m/s.
    [(0.04, -0.04), (0.2, -0.05)],
)
def test_a_block_sticks_or_slides(speed, expected):
    problem = block((0.6 * speed, 0.8 * speed), 0.5)
    answer = study.outer_loop(problem)
    share = expected / speed
    assert answer.impulses == pytest.approx([0.1, 0.6 * speed * share, 0.8 * speed * share])
    assert (answer.why, problem.residual(answer.impulses)) == ('', pytest.approx(0.0, abs=1e-6))


def test_without_impulses_the_residual_is_the_missing_impulse():
    """|r - P(r - u - μ|u_t| n)|: a block at rest with r = 0 misses 0.1 of |q| = 0.1."""
    assert block((0.0, 0.0), 0.5).residual(np.zeros(3)) == pytest.approx(1.0)
    lifted = study.Problem.of('up', np.eye(3), [0.1, 0.0, 0.0], [0.5])
    assert lifted.residual(np.zeros(3)) == 0.0


def test_on_four_feet_only_loads_near_the_last_settle():
    """Four feet share a load in several ways: then a loop that takes any of them jumps."""
    problems = [each for each in study.own(6, 0) if each.name.startswith('quadruped')]
    any_loads = [study.outer_loop(each, study.FREE) for each in problems]
    near = [study.outer_loop(each) for each in problems]
    assert all(answer.why == '' for answer in near)
    assert any('still' in answer.why for answer in any_loads)
    for problem, answer in zip(problems, near, strict=True):
        r, u = answer.impulses.reshape(-1, 3), problem.compliance @ answer.impulses + problem.free
        u = u.reshape(-1, 3)
        scale = float(np.linalg.norm(problem.free))
        # Signorini and Coulomb, one by one.
        assert u[:, 0].min() > -1e-5 * scale
        assert abs(r[:, 0] * u[:, 0]).max() < 1e-5 * scale**2
        pull, speed = np.hypot(r[:, 1], r[:, 2]), np.hypot(u[:, 1], u[:, 2])
        assert (pull <= problem.friction * r[:, 0] + 1e-5 * scale).all()
        slides = speed > 1e-3 * scale
        assert pull[slides] == pytest.approx((problem.friction * r[:, 0])[slides], rel=1e-3)
        along = (r[:, 1:] * u[:, 1:]).sum(axis=1)
        assert along[slides] == pytest.approx(-(pull * speed)[slides], rel=1e-3)


def test_bodies_are_raised_to_their_lever():
    """0.8 · 0.12 m over (4 · 0.2231 m + 2 · 0.224 m)/6; twice as high it is twice as much."""
    body = study.Scene.load(study.SCENES[0]).body
    assert study.lever(body, 0.8) == pytest.approx(0.4297, abs=1e-4)
    raised = replace(body, height=2.0 * body.height)
    assert study.lever(raised, 0.8) == pytest.approx(0.8594, abs=2e-4)


def test_the_table_counts_what_is_solved(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(study, 'LEVERS', (0.5,))
    words = ['friction_problems', '--own', '1', '--repeats', '1', '--out', str(tmp_path)]
    assert main(words) == 0
    lines = capsys.readouterr().out.splitlines()
    names = [line[2:].partition(',')[0] for line in lines[2:]]
    assert names == ['hexapod_patches on 6 feet', 'quadruped_patches on 4 feet', 'μh/a 0.5']
    kept = json.loads((tmp_path / 'friction_problems.json').read_text(encoding='utf-8'))
    for line in lines[2:]:
        kinds = [each for each in kept['kinds'] if each['problems'] in line]
        assert line.count('1 of 1; ') == sum(each['solved'] for each in kinds) >= 2

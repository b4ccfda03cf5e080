# SPDX-License-Identifier: Apache-2.0
"""Generated meshes of pads have the right size; broken meshes are refused with their name."""

import builtins
import math

import numpy as np
import pytest

from ros_pad.capillary import Mesh
from ros_pad.errors import InvalidInput, MeshError

R, B = 1.55e-3, 0.583e-3
CUBE_POINTS = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)]) * 1e-3
CUBE_FACES = np.array(
    [
        *([0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1]),
        *([2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]),
    ]
)


def cube():
    return Mesh(CUBE_POINTS, CUBE_FACES, 'cube')


def test_a_cube_has_its_volume_and_height():
    assert cube().volume == pytest.approx(1e-9, rel=1e-12)
    assert cube().height == pytest.approx(1e-3, rel=1e-12)


def test_a_dome_has_the_volume_of_a_spherical_segment():
    # Volume from two radii and a height: pi h (3 a² + 3 b² + h²) / 6.
    centre = math.sqrt(R * R - B * B)
    for height in (0.3e-3, centre, centre + 0.9 * R):
        top = R * R - (height - centre) ** 2
        exact = math.pi * height * (3 * B * B + 3 * top + height**2) / 6
        errors = [
            1.0 - Mesh.dome(R, B, height, rings, 2 * rings).volume / exact for rings in (40, 80)
        ]
        assert 0.0 < errors[1] < 2e-3
        assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.05)


def test_cone_and_cylinder_have_their_volumes():
    polygon = 0.5 * 72 * math.sin(2 * math.pi / 72)  # area in a circle of radius 1
    cone = Mesh.cone(1e-3, 2e-3, 3e-3)
    assert cone.volume == pytest.approx(polygon * 3e-3 * (1 + 2 + 4) * 1e-6 / 3, rel=1e-9)
    assert Mesh.cone(0.0, 1e-3, 3e-3).volume == pytest.approx(polygon * 1e-9, rel=1e-9)
    assert Mesh.cylinder(1e-3, 2e-3).volume == pytest.approx(polygon * 2e-9, rel=1e-9)


def test_a_pattern_is_hexagonal():
    pattern = Mesh.dome_pattern(19, 3.2e-3, R, B, rings=2, sectors=6)
    assert pattern.volume == pytest.approx(19 * Mesh.dome(R, B, None, 2, 6).volume, rel=1e-9)
    middles = np.array([each.mean(axis=0)[:2] for each in np.split(pattern.points, 19)])
    apart = np.hypot(*(middles[:, None] - middles[None]).T)
    assert middles[0] == pytest.approx([0.0, 0.0], abs=1e-12)
    # Of 19 pads in a hexagon 7 have six neighbours, 6 have four and 6 have three.
    neighbours = np.sum(np.isclose(apart, 3.2e-3, rtol=1e-6), axis=0)
    assert sorted(neighbours) == [3] * 6 + [4] * 6 + [6] * 7


@pytest.mark.parametrize(
    ('call', 'part'),
    [
        (lambda: Mesh.dome(1e-3, 1e-3), 'contact_radius = 0.001'),
        (lambda: Mesh.dome(1e-3, 0.0, 2e-3), 'height = 0.002'),
        (lambda: Mesh.cone(0.0, 0.0, 1e-3), 'top_radius = 0'),
    ],
)
def test_generators_name_what_is_wrong(call, part):
    with pytest.raises(InvalidInput) as error:
        call()
    assert part in str(error.value)


def changed(points=CUBE_POINTS, faces=CUBE_FACES):
    return Mesh(points, faces, 'changed')


TWO = np.concatenate([CUBE_POINTS, CUBE_POINTS + np.array([2e-3, 0, 0])])
FLAT = CUBE_POINTS.copy()
FLAT[3] = np.nan


@pytest.mark.parametrize(
    ('points', 'faces', 'part'),
    [
        (np.empty((0, 3)), CUBE_FACES, '(0, 3)'),
        (CUBE_POINTS[:, :2], CUBE_FACES, '(8, 2)'),
        (CUBE_POINTS, CUBE_FACES.astype(float), 'integers'),
        (CUBE_POINTS, CUBE_FACES + 1, '1 to 8'),
        (FLAT, CUBE_FACES, 'point 3 is not finite'),
        (CUBE_POINTS, CUBE_FACES[1:], '3 open edges (holes)'),
        (CUBE_POINTS, np.concatenate([CUBE_FACES, CUBE_FACES[:1]]), 'non-manifold'),
        (CUBE_POINTS, np.concatenate([CUBE_FACES[:1, ::-1], CUBE_FACES[1:]]), 'flipped'),
        (CUBE_POINTS, CUBE_FACES[:, ::-1], 'the mesh is inside out'),
        (CUBE_POINTS, np.concatenate([CUBE_FACES[:-1], [[1, 1, 3]]]), 'triangle 11 '),
        (TWO, np.concatenate([CUBE_FACES, 8 + CUBE_FACES[:, ::-1]]), '1 of 2 bodies'),
        (CUBE_POINTS + np.array([0, 0, 1e-4]), CUBE_FACES, 'lift = -0.0001 m'),
        (CUBE_POINTS - np.array([0, 0, 1e-4]), CUBE_FACES, 'lift = 0.0001 m'),
        (1e3 * CUBE_POINTS, CUBE_FACES, 'scale=1e-3'),
        (1e-3 * CUBE_POINTS, CUBE_FACES, '1e-05 to 0.5 m'),
    ],
)
def test_broken_meshes_are_refused(points, faces, part):
    with pytest.raises(MeshError) as error:
        changed(points, faces)
    assert part in str(error.value)
    assert str(error.value).startswith('changed: ')


def test_what_files_miss_the_floor_by_is_taken_off():
    for low in (-5e-9, 5e-9):
        mesh = changed(CUBE_POINTS + np.array([0, 0, low]))
        assert mesh.points[:, 2].min() == 0.0
        assert mesh.height == pytest.approx(1e-3, rel=1e-9)


@pytest.mark.parametrize('suffix', ['.stl', '.obj', '.ply', '.msh'])
def test_files_come_back(suffix, tmp_path):
    pytest.importorskip('meshio')
    path = tmp_path / f'dome{suffix}'
    dome = Mesh.dome(R, B, rings=8, sectors=12)
    dome.write(path)
    again = Mesh.read(path)
    assert again.source == str(path)
    assert len(again.points) == len(dome.points)
    assert len(again.faces) == len(dome.faces)
    assert again.volume == pytest.approx(dome.volume, rel=1e-6)
    with pytest.raises(InvalidInput, match='exists already and is not overwritten'):
        dome.write(path)
    with pytest.raises(MeshError, match='flip=True'):
        Mesh.read(path, flip=True)
    with pytest.raises(MeshError, match=r'lift = -0\.001 m'):
        Mesh.read(path, lift=1e-3)
    with pytest.raises(MeshError, match='scale=1e-3'):
        Mesh.read(path, scale=1e3)
    assert Mesh.read(path, scale=2.0).volume == pytest.approx(8.0 * dome.volume, rel=1e-6)


def test_quadrangles_are_read(tmp_path):
    meshio = pytest.importorskip('meshio')
    quads = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    meshio.Mesh(CUBE_POINTS, [('quad', np.array(quads))]).write(tmp_path / 'quads.ply')
    assert Mesh.read(tmp_path / 'quads.ply').volume == pytest.approx(1e-9, rel=1e-6)


@pytest.mark.parametrize(
    ('name', 'text'),
    [
        ('a.stl', ''),
        ('a.stl', 'solid\nfacet'),
        ('a.obj', 'v one two three\nf 1 2 3'),
        ('a.obj', 'f 1 2 3'),
        ('a.obj', 'v 0 0 nan\nv 1 0 0\nv 0 1 0\nf 1 2 3'),
        ('a.ply', 'ply\nformat nothing 1.0'),
        ('a.msh', '$MeshFormat\n9.9 0 8\n'),
        ('a.msh', ''),
    ],
)
def test_files_that_are_no_meshes(name, text, tmp_path, capfd):
    pytest.importorskip('meshio')
    (tmp_path / name).write_text(text)
    with pytest.raises(MeshError) as error:
        Mesh.read(tmp_path / name)
    assert str(tmp_path / name) in str(error.value)
    assert capfd.readouterr().out == ''


def test_missing_files_and_other_endings(tmp_path):
    with pytest.raises(MeshError, match='no such file'):
        Mesh.read(tmp_path / 'none.stl')
    with pytest.raises(MeshError, match=r'\.stl, \.obj, \.ply, \.msh'):
        Mesh.read(tmp_path / 'none.step')


def test_without_meshio_the_pip_line_is_named(tmp_path, monkeypatch):
    real = builtins.__import__

    def without(name, *rest):
        if name == 'meshio':
            raise ModuleNotFoundError(name)
        return real(name, *rest)

    monkeypatch.setattr(builtins, '__import__', without)
    with pytest.raises(MeshError, match=r"pip install 'ros_pad\[mesh\]'"):
        cube().write(tmp_path / 'cube.stl')

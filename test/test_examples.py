# SPDX-License-Identifier: Apache-2.0
"""The examples: short, run from any folder, agree with independent values, draw their pictures."""

import ast
import itertools
import json
import math
import pathlib
import re
import runpy
import sys
from collections.abc import Callable

import matplotlib.pyplot as plt
import numpy as np
import pytest
from rosbags.highlevel import AnyReader
from scipy.optimize import brentq

from ros_pad.contact import LARGE_PAD, WATER, Foot, press

ROOT = pathlib.Path(__file__).resolve().parent.parent
EXAMPLES = sorted((ROOT / 'examples').glob('*.py'))
PAGE = ROOT / 'docs' / 'examples.md'
REFERENCE = ROOT / 'test' / 'reference'
CELL = 2.0 * math.sqrt(3.0) * 2.25e-6 * 2.25  # m²: hexagon round a sphere of 1.5 radii (3.83)
BAG = ROOT / 'bags' / 'hexapod_patches' / 'bag'

Run = Callable[..., str]


@pytest.fixture
def run(tmp_path, monkeypatch, capsys):
    """Return a function that runs an example in another folder, and returns what it prints.

    ``marked`` replaces what the line for the user's data has on its right side.
    """
    monkeypatch.chdir(tmp_path)
    plt.switch_backend('Agg')

    def run(name, marked=None):
        path = ROOT / 'examples' / f'{name}.py'
        if marked is not None:
            text, changes = re.subn(
                r'^(.*) = .*# <- .*$', rf'\1 = {marked}', path.read_text(), flags=re.MULTILINE
            )
            assert changes == 1
            path = tmp_path / path.name
            path.write_text(text)
        monkeypatch.setattr(sys, 'argv', [str(path), 'out.png'])
        runpy.run_path(str(path), run_name='__main__')
        plt.close('all')
        picture = plt.imread('out.png')
        assert picture.shape[1] >= 1000
        # Lines and words cover some of the paper, and not most of it.
        assert 0.01 < np.mean(picture[..., :3].min(axis=2) < 0.9) < 0.5
        return capsys.readouterr().out

    return run


def numbers(text):
    return [float(each) for each in re.findall(r'(?<![\w.])-?\d+(?:\.\d+)?', text)]


@pytest.mark.parametrize('path', EXAMPLES, ids=lambda path: path.stem)
def test_an_example_is_short_public_and_on_its_page(path):
    text = path.read_text(encoding='utf-8')
    module = ast.parse(text)
    docstring = module.body[0]
    lines = len(text.splitlines()) - 1 - (docstring.end_lineno - docstring.lineno + 1)
    assert lines <= 30
    assert len(re.findall('# <- your ', text)) == 1
    for node in ast.walk(module):
        if isinstance(node, ast.ImportFrom) and node.module.startswith('ros_pad'):
            public = __import__(node.module, fromlist=['__all__'])
            for each in node.names:
                assert each.name in getattr(public, '__all__', ['shared_folder'])
        if isinstance(node, ast.Attribute):
            assert node.attr == '_fields' or not node.attr.startswith('_')
    page = PAGE.read_text(encoding='utf-8')
    assert f'](../examples/{path.name})' in page
    assert f'](charts/example_{path.stem}.png)' in page


def test_dome_under_load(run):
    free, limit, *points = run('dome_under_load').splitlines()
    # Thesis 3.60 with F = 0: p r/k = 6 sin t - 2 sin 2t, height r tan t.
    tilt = brentq(lambda t: 6 * math.sin(t) - 2 * math.sin(2 * t) - 75e3 * 1.5e-3 / 40, 0.1, 1.2)
    assert numbers(free)[0] == pytest.approx(1.5 * math.tan(tilt), abs=6e-4)
    assert numbers(limit)[0] == pytest.approx(0.30, rel=0.07)  # measured
    assert numbers(limit)[1] == 0.4  # the sheet is as thick
    measured = [(0.08, 1.8 - 0.084434), (0.19, 1.4 - 0.36217), (0.285, 1.0 - 0.4368)]
    for line, (force, gap) in zip(points, measured, strict=True):
        found = numbers(line)
        assert found[0] == force
        assert found[2] == pytest.approx(gap, abs=6e-4)
        assert found[1] == pytest.approx(gap, rel=0.12)  # by docs/model/dome.md


def level_above_the_sole(load, pressure):
    """Return by how much water between domes would be above the sole, m, in closed form.

    The energy of a level surface at z between spheres, ρ g z (S - π r²) + 2 π γ (z - z_c)
    - 2 π R γ cos θ = 0 with r² = R² - (z - z_c)², is that of `level surface` in docs/capillary.md.
    """
    dome, g = press(LARGE_PAD, pressure, load), 9.81
    radius, gamma = dome.sphere_radius, WATER.surface_tension
    centre = math.sqrt(radius**2 - dome.contact_radius**2)

    def pull(z):
        void = CELL - math.pi * (radius**2 - (z - centre) ** 2)
        rise = (z - centre) - radius * math.cos(WATER.angle)
        return WATER.density * g * z * void + 2.0 * math.pi * gamma * rise

    return brentq(pull, 0.0, centre + radius) - dome.gap


def test_when_a_foot_floods(run):
    out = run('when_a_foot_floods').splitlines()
    for line, pressure in zip(out, (70e3, 80e3, 90e3), strict=True):
        kilopascals, load, depth = numbers(line)
        assert kilopascals == pressure / 1e3
        floods = brentq(level_above_the_sole, 0.005, 0.4, args=(pressure,))
        step = 0.02  # N between loads, at most
        assert floods - 1e-3 <= load <= floods + step
        dome = press(LARGE_PAD, pressure, load)
        z = np.linspace(0.0, dome.gap, 2001)
        centre = math.sqrt(dome.sphere_radius**2 - dome.contact_radius**2)
        void = CELL - math.pi * (dome.sphere_radius**2 - (z - centre) ** 2)
        assert depth == pytest.approx(1e3 * np.mean(void) * dome.gap / CELL, abs=0.02)


def test_slip_from_csv(run):
    data = np.genfromtxt(ROOT / 'examples' / 'slip.csv', delimiter=',', names=True)
    stiffness = Foot.load('large37').shear_stiffness
    contact = np.stack([data['x'] + data['fx'] / stiffness, data['y'] + data['fy'] / stiffness])
    cycle = np.floor(data['t'] + 0.6)  # The foot lands at 0.4 s of each, and may bounce.
    slips = np.zeros(7)
    lines = run('slip_from_csv').splitlines()
    assert '\n'.join(lines) in PAGE.read_text(encoding='utf-8')
    for line in lines:
        begin, slip, wet = numbers(line)[:3]
        slips[int(begin + 0.6)] = max(slips[int(begin + 0.6)], slip)
        # The floor of this leg is wet, and the first stances have no pull.
        assert wet > 0.5 or (begin < 1.44 and 'not pulled' in line)
    for number, slip in enumerate(slips):
        # Net motion of the contact after the landing of 20 ms, from five readings at either end.
        # The alarm leaves out what is slower than 15 mm/s, and each time half a millimetre more.
        stands = contact[:, (cycle == number) & (data['fz'] > 0.5)]
        net = 1e3 * np.hypot(*(stands[:, -5:].mean(axis=1) - stands[:, 5:10].mean(axis=1)))
        assert slip == pytest.approx(net, abs=2.5) if net > 5.0 else slip < 5.0
    assert np.count_nonzero(slips > 4.0) == 3


def test_the_csv_is_from_the_bag(monkeypatch, tmp_path):
    (program,) = re.findall(r'^```python\n(.*?)^```$', PAGE.read_text(), re.DOTALL | re.MULTILINE)
    (tmp_path / 'bags').symlink_to(ROOT / 'bags')
    monkeypatch.chdir(tmp_path)
    exec(compile(program, str(PAGE), 'exec'), {})
    shipped = ROOT / 'examples' / 'slip.csv'
    assert (tmp_path / 'slip.csv').read_bytes() == shipped.read_bytes()
    assert shipped.stat().st_size <= 200_000


@pytest.mark.parametrize('place', [0, 2])
def test_pressure_for_a_load(place, run, tmp_path):
    # Limits of the same sheet by shooting, without code of ros_pad.
    reference = json.loads((REFERENCE / 'force_limits.json').read_text())
    c1, c2, c3 = reference['yeoh']
    (tmp_path / 'mine.yaml').write_text(
        f'law: yeoh\nparameters: {{C1: {c1}, C2: {c2}, C3: {c3}}}\nlargest_stretch: 4.5\n'
        'source: test\ndoubts: none\nfactor: {value: 1.88, low: 1.88, high: 2.1}\n'
    )
    load = reference['limits']['thickness'][place]
    out = run('pressure_for_a_load', f"{load}, 'mine.yaml', 1.5e-3, 0.4e-3")
    newtons, low, high = numbers(out.splitlines()[0])
    assert newtons == load
    assert 1e3 * low == pytest.approx(reference['pressures'][place], rel=0.003)
    assert low < high < 1.12 * low  # pressure in proportion to the modulus, at the same shape


def test_replay_a_bag(run):
    out = run('replay_a_bag')
    assert out in PAGE.read_text(encoding='utf-8')
    first, *legs = out.splitlines()
    assert first.endswith('different')
    with AnyReader([BAG]) as reader:  # another reader
        messages = reader.messages([c for c in reader.connections if c.topic == '/feet/command'])
        commands = [reader.deserialize(raw, c.msgtype) for c, _, raw in messages]
    domes = [dict(zip(each.name, each.position, strict=True)) for each in commands]
    switches = {
        leg: sum(
            a[f'leg_{leg}/dome'] != b[f'leg_{leg}/dome'] for a, b in itertools.pairwise(domes)
        )
        for leg in range(1, 7)
    }
    for line in legs:
        leg, was_wet, wet, was, _ = numbers(line)
        assert was == switches[leg]
        assert wet <= was_wet  # wet ground has become less probable

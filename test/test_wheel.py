# SPDX-License-Identifier: Apache-2.0
"""The sdist has the whole source, and the wheel made of it works outside of a checkout.

Nothing is fetched: the virtual environment in which the wheel is installed takes its libraries
from the one that runs the tests. With ``WHEEL_LIBRARIES=index`` they are installed anew, as
``make test-matrix MATRIX=3.12-wheel`` does.
"""

import json
import os
import pathlib
import shutil
import subprocess
import sys
import tarfile
import venv
import xml.etree.ElementTree

import numpy as np
import pytest

import ros_pad

setuptools = pytest.importorskip('setuptools', minversion='77')

# Wheel and sdist are built, and installed twice.
pytestmark = pytest.mark.slow

ROOT = pathlib.Path(__file__).resolve().parent.parent
LIBRARIES = pathlib.Path(np.__file__).parent.parent
NOT_SOURCE = ('.*', '__pycache__', '*.egg-info', 'build', 'dist', 'install', 'log', 'runs')
BUILD = """
import os, sys
from setuptools import build_meta
source, folder, kind = sys.argv[1:]
os.chdir(source)
print(getattr(build_meta, f'build_{kind}')(folder))
"""


def run(*command, status=0, **options):
    """Run a command, which must end with a status; return its output."""
    child = subprocess.run(
        list(map(str, command)), capture_output=True, text=True, timeout=300, **options
    )
    assert child.returncode == status, child.stdout + child.stderr
    return child.stdout + child.stderr * bool(status)


def built(source, folder, kind):
    """Build a wheel or an sdist of a source folder; return it."""
    return folder / run(sys.executable, '-c', BUILD, source, folder, kind).split()[-1]


@pytest.fixture(scope='module')
def sdist(tmp_path_factory):
    """Return the unpacked sdist of a copy of the checkout."""
    folder = tmp_path_factory.mktemp('sdist')
    shutil.copytree(ROOT, folder / 'copy', ignore=shutil.ignore_patterns(*NOT_SOURCE))
    shutil.copytree(ROOT / '.ci', folder / 'copy' / '.ci')
    with tarfile.open(built(folder / 'copy', folder, 'sdist')) as archive:
        archive.extractall(folder, filter='data')
    (unpacked,) = folder.glob('ros_pad-*/')
    return unpacked


@pytest.fixture(scope='module')
def wheel(sdist, tmp_path_factory):
    """Return the wheel built from the sdist."""
    return built(sdist, tmp_path_factory.mktemp('wheel'), 'wheel')


@pytest.fixture(scope='module')
def programs(wheel, tmp_path_factory):
    """Return the folder of the programs of an environment in which the wheel is installed."""
    place = tmp_path_factory.mktemp('environment')
    venv.create(place)
    if os.environ.get('WHEEL_LIBRARIES') == 'index':
        own = place / 'bin' / 'python'
        run(sys.executable, '-m', 'pip', '--python', own, 'install', '--quiet', f'{wheel}[plot]')
        return place / 'bin'
    (packages,) = place.glob('lib/python*/site-packages')
    (packages / 'libraries.pth').write_text(f'{LIBRARIES}\n', encoding='utf-8')
    pip('--prefix', place, wheel)
    return place / 'bin'


def pip(*arguments):
    """Install without libraries and network."""
    run(
        *(sys.executable, '-m', 'pip', 'install', '--quiet', '--no-deps', '--no-index'),
        *('--ignore-installed', *arguments),
    )


def outside(**more):
    """Return the environment variables of a shell that has no ROS and no checkout."""
    left_out = ('PYTHONPATH', 'AMENT_PREFIX_PATH', 'VIRTUAL_ENV')
    return {name: text for name, text in os.environ.items() if name not in left_out} | more


@pytest.fixture
def pad(programs, tmp_path):
    """Return a function that runs `pad` in an empty folder and returns its output."""

    def of(*words, status=0, **variables):
        python = programs / 'python'
        options = {'cwd': tmp_path, 'env': outside(**variables)}
        return run(python, programs / 'pad', *words, status=status, **options)

    return of


def test_the_sdist_is_the_whole_source(sdist):
    listing = subprocess.run(
        ['git', 'ls-files'], cwd=ROOT, capture_output=True, text=True, timeout=60
    )
    if listing.returncode:
        pytest.skip('not a checkout of the repository: there is no list of its files')
    tracked = {name for name in listing.stdout.split('\n') if name and name[0] not in '."'}
    assert {'README.md', 'LICENSE', 'CHANGELOG.md', 'config/params.yaml', 'setup.py'} <= tracked
    missing = {
        name for name in tracked if (ROOT / name).is_file() and not (sdist / name).is_file()
    }
    assert not missing


FOUND = """
import json, pathlib
from importlib import metadata
import ros_pad
from ros_pad import configuration
from ros_pad.contact import Foot, Material
from ros_pad.robots import Robot
from ros_pad.simulation import Scene
folder = configuration.shared_folder()
load = {'feet': Foot.load, 'materials': Material.load, 'scenes': Scene.load}
for kind, read in load.items():
    for name in configuration.names(kind):
        if not name.startswith('bench_'):
            read(name)
Robot.load('ch3r')
about = metadata.metadata('ros_pad')
print(json.dumps({'package': ros_pad.__file__, 'config': str(folder),
    'files': sorted(str(each.relative_to(folder.parent)) for each in folder.parent.rglob('*.*')
        if each.suffix != '.pyc'),
    'about': about.json, 'version': ros_pad.__version__}))
"""


@pytest.fixture(scope='module')
def found(programs):
    """Return where the installed package finds its files, and its metadata."""
    return json.loads(run(programs / 'python', '-c', FOUND, cwd='/', env=outside()))


def test_the_package_finds_its_own_files(found, programs):
    place = programs.parent
    assert pathlib.Path(found['package']).is_relative_to(place)
    assert found['config'] == str(place / 'share' / 'ros_pad' / 'config')
    shipped = [
        str(path.relative_to(ROOT))
        for folder in ('config', 'launch')
        for path in (ROOT / folder).rglob('*.*')
        if path.suffix != '.pyc'
    ]
    assert found['files'] == sorted([*shipped, 'package.xml'])


def test_the_metadata_are_those_of_package_xml(found):
    package = xml.etree.ElementTree.parse(ROOT / 'package.xml').getroot()
    about = found['about']
    assert about['version'] == found['version'] == ros_pad.__version__
    assert about['version'] == package.findtext('version')
    assert about['license_expression'] == package.findtext('license')


def test_pad_works_outside_of_a_checkout(pad, tmp_path):
    assert 'hexapod_patches' in pad('scenes')
    values = json.loads(pad('contact', '--pressure', '75e3', '--json'))
    assert values
    walk = ('run', 'leg_wet_flat', '--no-ros', '--cycles', '1', '--json')
    summary = json.loads(pad(*walk, '--out', 'walk'))
    assert summary['distance_m'] > 0.0
    assert (tmp_path / 'walk' / 'report.html').stat().st_size > 1e5
    text = pad('run', 'bench_press', status=1)
    assert 'studies are only in the source' in text


def test_without_matplotlib_pad_does_the_rest(pad, tmp_path):
    missing = tmp_path / 'missing'
    (missing / 'matplotlib').mkdir(parents=True)
    (missing / 'matplotlib' / '__init__.py').touch()
    # What it raises where it was built for another NumPy.
    (missing / 'matplotlib' / 'figure.py').write_text('raise ImportError("numpy.core.multiarray")')
    without = {'PYTHONPATH': str(missing)}
    walk = ('run', 'leg_dry_flat', '--no-ros', '--cycles', '1', '--out', 'walk')
    assert 'report:   none: without Matplotlib' in pad(*walk, **without)
    files = {path.name for path in (tmp_path / 'walk').iterdir()}
    assert files == {'summary.json', 'learnt.yaml'}
    thesis = ROOT / 'config' / 'measurements' / 'thesis.csv'
    fit = ('calibrate', str(thesis), '--out', 'foot.yaml')
    assert 'picture: none' in pad(*fit, **without)
    assert (tmp_path / 'foot.yaml').is_file()
    remedy = "pip install 'ros_pad[plot]'"
    design = ('design', '--load', '5', '--sole-radius', '0.02')
    pad(*design, **without)
    assert remedy in pad(*design, '--figure', 'a.png', status=2, **without)
    assert not (tmp_path / 'a.png').exists()
    study = (sys.executable, '-m', 'studies', 'contact')
    assert remedy in run(*study, status=2, cwd=ROOT, env=outside(**without))

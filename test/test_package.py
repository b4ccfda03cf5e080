# SPDX-License-Identifier: Apache-2.0
"""colcon builds the package, and what ``ros2 run`` and the ament index need is in place."""

import os
import pathlib
import shutil
import subprocess
import sys
import xml.etree.ElementTree

import pytest

import ros_pad

pytest.importorskip('colcon_core', reason='colcon is not installed: pip install ros_pad[test]')
packages = pytest.importorskip('ament_index_python.packages')

# colcon builds the package several times.
pytestmark = pytest.mark.slow

ROOT = pathlib.Path(__file__).resolve().parent.parent
NODES = {
    f'{node}_node'
    for node in (
        *('body_estimator', 'controller', 'estimator'),
        *('merge', 'recorder', 'regulator', 'simulator', 'views'),
    )
}
EXECUTABLES = NODES | {'pad'}


@pytest.fixture(scope='module')
def workspace(tmp_path_factory):
    """Return a colcon workspace in which ros_pad is built."""
    folder = tmp_path_factory.mktemp('workspace')
    source = folder / 'src' / 'ros_pad'
    source.mkdir(parents=True)
    for name in ('package.xml', 'pyproject.toml', 'setup.py', 'setup.cfg', 'LICENSE', 'README.md'):
        shutil.copy(ROOT / name, source)
    for name in ('config', 'launch', 'resource', 'ros_pad'):
        shutil.copytree(ROOT / name, source / name, ignore=shutil.ignore_patterns('__pycache__'))
    child = subprocess.run(
        [sys.executable, '-m', 'colcon', 'build'],
        cwd=folder,
        env=os.environ | {'COLCON_HOME': str(folder)},
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert child.returncode == 0, child.stdout + child.stderr
    return folder


def in_workspace(workspace, *command):
    """Run a command, which must succeed, in a shell that has sourced the workspace; return what
    it prints."""
    child = subprocess.run(
        ['bash', '-c', '. install/setup.bash && exec "$@"', 'bash', *command],
        cwd=workspace,
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert child.returncode == 0, child.stdout + child.stderr
    return child.stdout


def test_the_ament_index_lists_package_and_executables(workspace, monkeypatch):
    prefix = workspace / 'install' / 'ros_pad'
    monkeypatch.setenv('AMENT_PREFIX_PATH', str(prefix))
    assert packages.get_packages_with_prefixes() == {'ros_pad': str(prefix)}
    # `ros2 run` searches for executables like this.
    folder = prefix / 'lib' / 'ros_pad'
    found = {path.name for path in folder.iterdir() if os.access(path, os.X_OK)}
    assert found == EXECUTABLES


def test_the_command_runs_and_finds_its_scenes(workspace):
    pad = 'install/ros_pad/lib/ros_pad/pad'
    assert 'pad run' in in_workspace(workspace, pad, 'run', '--help')
    assert 'hexapod_patches' in in_workspace(workspace, pad, 'scenes')


def test_the_nodes_find_their_files_through_the_ament_index(workspace):
    """They do so without a source tree beside the package, as started by `ros2 run`."""
    folder = in_workspace(workspace, sys.executable, '-c', SHARED_FOLDER).strip()
    assert (pathlib.Path(folder) / 'params.yaml').is_file()
    assert pathlib.Path(folder).resolve().is_relative_to(workspace.resolve())


SHARED_FOLDER = """
from ros_pad.configuration import shared_folder
print(shared_folder())
"""


def test_package_xml():
    package = xml.etree.ElementTree.parse(ROOT / 'package.xml').getroot()
    assert package.findtext('export/build_type') == 'ament_python'
    assert package.findtext('version') == ros_pad.__version__
    keys = {node.text for node in package if node.tag.endswith('depend')}
    assert 'rclpy' in keys

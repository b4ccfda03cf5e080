# SPDX-License-Identifier: Apache-2.0
"""Parts import only what the table in docs/imports.yaml allows, and only the nodes need ROS."""

import ast
import functools
import pathlib
import re
import sys

import pytest
import yaml
from shared import python

ROOT = pathlib.Path(__file__).resolve().parent.parent
SOURCE = ROOT / 'ros_pad'
TABLE = yaml.safe_load((ROOT / 'docs' / 'imports.yaml').read_text(encoding='utf-8'))

ROS = {
    *('rclpy', 'ament_index_python', 'builtin_interfaces', 'diagnostic_msgs', 'geometry_msgs'),
    *('lifecycle_msgs', 'nav_msgs', 'rcl_interfaces', 'rosgraph_msgs', 'sensor_msgs', 'std_msgs'),
    *('std_srvs', 'tf2_msgs', 'visualization_msgs'),
}
NO_WHEEL = {'tf2_msgs'}  # of ROS, but not on PyPI: imported where it is asked for
# Packages of extras: functions that need them import them inside, as they may be missing. All of
# ros_pad.reports needs Matplotlib; functions that need reports import them inside.
EXTRAS = {
    'matplotlib': 'plot',
    'mujoco': 'mujoco',
    'numba': 'fast',
    'distributed': 'sweep',
    'pyarrow': 'sweep',
    'meshio': 'mesh',
    'manifold3d': 'make',
    'nicegui': 'explore',
    'starlette': 'explore',
}
WORDS = {'rclpy and the messages': ROS, 'matplotlib': {'matplotlib', 'mpl_toolkits'}}


@functools.cache
def allowed(part):
    """Return the parts that a part may import: those of its row, and all that these may import."""
    direct = TABLE[part].get('imports', [])
    return frozenset({*direct, *(each for other in direct for each in allowed(other))})


def libraries(part, key):
    """Return the packages of other projects in one column of a part's row."""
    return {name for word in TABLE[part].get(key, []) for name in WORDS.get(word, {word})}


def files(part):
    """Return the source files of a part, which is one module or one package."""
    return [*SOURCE.glob(f'{part}.py'), *SOURCE.glob(f'{part}/**/*.py')]


def imports(path):
    """Return (dotted name, inside a function) of all imports in a file."""
    found = set()

    def visit(node, inside):
        inside |= isinstance(node, ast.FunctionDef)
        if isinstance(node, ast.Import):
            found.update((alias.name, inside) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f'{path} has a relative import: write the full name'
            found.update((f'{node.module}.{alias.name}', inside) for alias in node.names)
        for child in ast.iter_child_nodes(node):
            visit(child, inside)

    visit(ast.parse(path.read_text(encoding='utf-8')), False)
    return found


def test_the_table_has_every_part_and_every_part_imports_what_is_below_it():
    parts = {path.stem for path in SOURCE.glob('*') if path.stem not in ('__init__', 'py')}
    assert parts - {'__pycache__'} == set(TABLE)
    order = list(TABLE)
    for place, part in enumerate(order):
        assert allowed(part) <= set(order[place + 1 :])


@pytest.mark.parametrize('part', TABLE)
def test_imports_run_down(part):
    paths = files(part)
    assert paths
    used = set()
    for path in paths:
        for name, inside in imports(path):
            top, _, rest = name.partition('.')
            if top == 'ros_pad':
                other = rest.split('.')[0]
                # From the package itself only the version may be imported.
                assert other in {'', '__version__', part} | allowed(part), f'{path}: {name}'
            elif top not in sys.stdlib_module_names:
                used.add(top)
                known = libraries(part, 'libraries')
                known |= libraries(part, 'inside') if inside else set()
                assert top in known, f'{path} imports {name}'
    stated = libraries(part, 'libraries') | libraries(part, 'inside')
    assert stated - used <= ROS, 'the table has libraries that are not imported'


WITHOUT = """
import importlib
import pkgutil
import sys

class Missing:
    def find_spec(self, name, path=None, target=None):
        if name.split('.')[0] in {missing}:
            raise ModuleNotFoundError(f'there is no {{name}} here')

def is_left_out(name):
    return name.startswith(('ros_pad.nodes', 'ros_pad.reports'))

def failed(name):
    assert is_left_out(name), name

sys.meta_path.insert(0, Missing())
import ros_pad

for module in pkgutil.walk_packages(ros_pad.__path__, 'ros_pad.', onerror=failed):
    if not is_left_out(module.name):
        importlib.import_module(module.name)
        print(module.name)
try:
    import rclpy
except ModuleNotFoundError:
    print('no rclpy')
"""


def test_everything_but_nodes_and_reports_imports_without_ros_and_extras():
    script = WITHOUT.format(missing=sorted({*ROS, *EXTRAS}))
    child = python('-c', script, cwd=SOURCE.parent)
    assert child.returncode == 0, child.stderr
    imported = child.stdout.split('\n')
    assert 'no rclpy' in imported
    expected = {
        '.'.join(path.relative_to(SOURCE.parent).with_suffix('').parts).removesuffix('.__init__')
        for part in TABLE
        if part not in ('nodes', 'reports')
        for path in files(part)
    }
    assert expected <= set(imported)


QUICK = """
import sys
import ros_pad.contact

print(*sys.modules)
"""


def test_the_contact_model_imports_little():
    child = python('-c', QUICK, cwd=SOURCE.parent)
    assert child.returncode == 0, child.stderr
    names = child.stdout.split()
    foreign = {name.split('.')[0] for name in names} - set(sys.stdlib_module_names)
    own = {name for name in names if name.startswith('ros_pad.')}
    below = {name.split('.')[1] for name in own}
    assert {'ros_pad.contact', 'ros_pad.contact.dome'} <= own
    assert below == {'configuration', 'contact', 'errors'}
    assert 'numpy' in foreign
    assert not foreign & {'yaml', 'scipy', 'tqdm', 'rosbags', *EXTRAS, *ROS}


ROSDEP_KEY = {
    'yaml': 'python3-yaml',
    'mcap': 'mcap-ros2-support',
    'rosbags': 'python3-rosbags-pip',
    'mpl_toolkits': 'python3-matplotlib',
}
PIP_NAME = {
    'yaml': 'pyyaml',
    'mpl_toolkits': 'matplotlib',
    'serial': 'pyserial',
}


def test_what_is_imported_is_declared():
    package_xml = (SOURCE.parent / 'package.xml').read_text(encoding='utf-8')
    setup_py = (SOURCE.parent / 'setup.py').read_text(encoding='utf-8')
    names = {
        name.split('.')[0] for part in TABLE for path in files(part) for name, _ in imports(path)
    }
    foreign = names - sys.stdlib_module_names - {'ros_pad'}
    assert {'numpy', 'rclpy', *EXTRAS} <= foreign
    for name, extra in EXTRAS.items():
        assert re.search(rf"'{extra}': \[[^\]]*'{name}>=", setup_py)
    for name in foreign - set(EXTRAS):
        key = name if name in ROS else ROSDEP_KEY.get(name, f'python3-{name}')
        assert f'<exec_depend>{key}</exec_depend>' in package_xml
        if name in NO_WHEEL:
            continue
        # Names of ROS wheels begin with the distribution.
        pip_name = name.replace('_', '-') if name in ROS else PIP_NAME.get(name, name)
        assert re.search(rf"'{pip_name}['>\[]", setup_py), f'{pip_name} is not in setup.py'

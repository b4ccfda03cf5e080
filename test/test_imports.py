# SPDX-License-Identifier: Apache-2.0
"""The floors of docs/architecture.md: every import runs down, and only the nodes need ROS."""

import ast
import pathlib
import re
import subprocess
import sys

import pytest

SOURCE = pathlib.Path(__file__).resolve().parent.parent / 'ros_pad'

# The table of docs/architecture.md: what each part of ros_pad may import of the others.
GROUND = {'errors', 'configuration', 'pace'}
MAY_IMPORT = {
    'errors': set(),
    'pace': {'errors'},
    'configuration': {'errors'},
    'contact': GROUND,
    'capillary': GROUND | {'contact'},
    'estimation': GROUND | {'contact'},
    'control': GROUND | {'contact'},
    'simulation': GROUND | {'contact'},
    'regulators': GROUND | {'contact', 'estimation', 'control', 'simulation'},
}
MAY_IMPORT['trials'] = MAY_IMPORT['regulators'] | {'regulators'}
MAY_IMPORT['ladders'] = MAY_IMPORT['trials'] | {'trials', 'capillary'}
MAY_IMPORT['figures'] = MAY_IMPORT['ladders'] | {'ladders'}
MAY_IMPORT['nodes'] = MAY_IMPORT['trials'] | {'trials'}
MAY_IMPORT['doctor'] = MAY_IMPORT['trials'] | {'trials'}
MAY_IMPORT['commands'] = MAY_IMPORT['figures'] | {'figures', 'nodes', 'doctor'}
MAY_IMPORT['cli'] = MAY_IMPORT['commands'] | {'commands'}
MAY_IMPORT['__main__'] = {'cli'}

NUMERICS = {'numpy', 'scipy', 'yaml'}
FILES = {'mcap', 'mcap_ros2', 'matplotlib', 'mpl_toolkits', 'tqdm'}  # the fourth is of the third
ROS = {
    *('rclpy', 'ament_index_python', 'builtin_interfaces', 'diagnostic_msgs', 'geometry_msgs'),
    *('lifecycle_msgs', 'rcl_interfaces', 'rosgraph_msgs', 'sensor_msgs', 'std_msgs', 'std_srvs'),
    'visualization_msgs',
}
# What an extra brings: imported inside the functions that need it, missing where it is not asked
# for.
EXTRAS = {
    'mujoco': 'mujoco',
    'numba': 'fast',
    'distributed': 'sweep',
    'pyarrow': 'sweep',
    'meshio': 'mesh',
}
FOREIGN = dict.fromkeys(MAY_IMPORT, NUMERICS) | {
    'errors': set(),
    'capillary': NUMERICS | {'meshio'},
    'simulation': NUMERICS | {'mujoco', 'numba'},
    'regulators': NUMERICS | {'serial'},
    'trials': NUMERICS | FILES | {'distributed', 'pyarrow'},
    'ladders': NUMERICS | FILES | {'mpmath', 'mujoco'},
    'figures': NUMERICS | FILES,
    'nodes': NUMERICS | FILES | ROS,
    'doctor': {'serial'},
    'commands': NUMERICS | FILES,
    'cli': {'argcomplete'},
    '__main__': set(),
}


def files(part: str) -> list[pathlib.Path]:
    """Return the source files of a part, which is one module or one package."""
    return [*SOURCE.glob(f'{part}.py'), *SOURCE.glob(f'{part}/**/*.py')]


def imports(path: pathlib.Path) -> set[str]:
    """Return the absolute dotted names that a file imports, at its top or inside functions."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text(encoding='utf-8'))):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f'{path}: write imports out in full'
            found |= {f'{node.module}.{alias.name}' for alias in node.names}
    return found


def test_every_part_has_its_floor():
    parts = {
        path.stem for path in SOURCE.glob('*') if path.name not in ('__init__.py', 'py.typed')
    }
    assert parts - {'__pycache__'} == set(MAY_IMPORT)
    table = (SOURCE.parent / 'docs' / 'architecture.md').read_text(encoding='utf-8')
    for part in parts & set(MAY_IMPORT):
        assert f'`ros_pad.{part}`' in table


@pytest.mark.parametrize('part', MAY_IMPORT)
def test_imports_run_down(part: str):
    paths = files(part)
    assert paths
    for path in paths:
        for name in imports(path):
            top, _, rest = name.partition('.')
            if top == 'ros_pad':
                other = rest.split('.')[0]
                # The package itself has only the version.
                assert other in {'', '__version__', part} | MAY_IMPORT[part], f'{path}: {name}'
            elif top not in sys.stdlib_module_names:
                assert top in FOREIGN[part], f'{path} imports {name}'


def test_the_reader_of_imports_sees_them_all(tmp_path: pathlib.Path):
    path = tmp_path / 'module.py'
    path.write_text(
        'import a.b\nfrom c import d as e\ndef f():\n    if 1:\n        from g.h import i\n'
    )
    assert imports(path) == {'a.b', 'c.d', 'g.h.i'}


WITHOUT = """
import importlib
import pkgutil
import sys

class Missing:
    def find_spec(self, name, path=None, target=None):
        if name.split('.')[0] in {missing}:
            raise ModuleNotFoundError(f'there is no {{name}} here')

sys.meta_path.insert(0, Missing())
import ros_pad

for module in pkgutil.walk_packages(ros_pad.__path__, 'ros_pad.'):
    if module.name != 'ros_pad.nodes' and not module.name.startswith('ros_pad.nodes.'):
        importlib.import_module(module.name)
        print(module.name)
try:
    import rclpy
except ModuleNotFoundError:
    print('no rclpy')
"""


def test_everything_but_the_nodes_imports_without_ros_and_extras():
    child = subprocess.run(
        [sys.executable, '-c', WITHOUT.format(missing=sorted({*ROS, *EXTRAS}))],
        cwd=SOURCE.parent,
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert child.returncode == 0, child.stderr
    imported = child.stdout.split('\n')
    assert 'no rclpy' in imported
    expected = {
        '.'.join(path.relative_to(SOURCE.parent).with_suffix('').parts).removesuffix('.__init__')
        for part in MAY_IMPORT
        if part != 'nodes'
        for path in files(part)
    }
    assert expected <= set(imported)


ROSDEP_KEY = {
    'yaml': 'python3-yaml',
    'mcap': 'mcap-ros2-support',
    'mcap_ros2': 'mcap-ros2-support',
    'mpmath': 'python3-sympy',
    'mpl_toolkits': 'python3-matplotlib',
}
PIP_NAME = {
    'yaml': 'pyyaml',
    'mcap_ros2': 'mcap-ros2-support',
    'mpl_toolkits': 'matplotlib',
    'serial': 'pyserial',
}


def test_what_is_imported_is_declared():
    package_xml = (SOURCE.parent / 'package.xml').read_text(encoding='utf-8')
    setup_py = (SOURCE.parent / 'setup.py').read_text(encoding='utf-8')
    names = {
        name.split('.')[0] for part in MAY_IMPORT for path in files(part) for name in imports(path)
    }
    foreign = names - sys.stdlib_module_names - {'ros_pad'}
    assert {'numpy', 'rclpy', *EXTRAS} <= foreign
    for name, extra in EXTRAS.items():
        assert re.search(rf"'{extra}': \[[^\]]*'{name}>=", setup_py)
    for name in foreign - set(EXTRAS):
        key = name if name in ROS else ROSDEP_KEY.get(name, f'python3-{name}')
        assert f'<exec_depend>{key}</exec_depend>' in package_xml
        # The wheels of ROS have the distribution before their name.
        pip_name = name.replace('_', '-') if name in ROS else PIP_NAME.get(name, name)
        assert re.search(rf"'{pip_name}['>\[]", setup_py), f'{pip_name} is not in setup.py'

# SPDX-License-Identifier: Apache-2.0
"""The launch file starts nodes that exist, and describes each argument.

Most tests parse its source, because launch is not on PyPI; if launch is installed, the file is
also executed.
"""

import ast
import pathlib

import pytest

ROOT = pathlib.Path(__file__).resolve().parent.parent
FILE = ROOT / 'launch' / 'ros_pad.launch.py'
NODES = (
    *('recorder_node', 'regulator_node', 'body_estimator_node', 'estimator_node'),
    *('controller_node', 'merge_node', 'views_node', 'simulator_node'),
)


DRIVERS = ('body_estimator_node', 'merge_node', 'views_node')
"""Nodes that a simulated walk with markers does not need."""


def assigned(tree, name):
    """Return the value of a literal that is assigned to a name at the top of a module."""
    (value,) = (
        each.value
        for each in tree.body
        if isinstance(each, ast.Assign) and each.targets[0].id == name
    )
    return ast.literal_eval(value)


@pytest.fixture(scope='module')
def tree():
    return ast.parse(FILE.read_text(encoding='utf-8'))


def first_arguments(tree, function):
    """Return the first argument of each call of a function if it is a literal."""
    return {
        call.args[0].value
        for call in ast.walk(tree)
        if isinstance(call, ast.Call)
        and getattr(call.func, 'id', '') == function
        and isinstance(call.args[0], ast.Constant)
    }


def test_every_node_is_an_executable_of_the_package(tree):
    setup = ast.parse((ROOT / 'setup.py').read_text(encoding='utf-8'))
    executables = {f'{name}_node' for name in assigned(setup, 'NODES')}
    assert first_arguments(tree, 'node') == executables == set(NODES)


def test_simulated_regulators_hear_of_the_scene_that_is_walked(tree):
    scenes = {
        call.args[0].value: ast.unparse(keyword.value)
        for call in ast.walk(tree)
        if isinstance(call, ast.Call) and getattr(call.func, 'id', '') == 'node'
        for keyword in call.keywords
        if keyword.arg == 'scene'
    }
    assert scenes == {'regulator_node': 'scene', 'simulator_node': 'scene'}


def started(given):
    """Return the executables that the file starts."""
    pytest.importorskip('launch_ros', reason='launch is not installed')
    from launch import LaunchContext
    from launch.actions import OpaqueFunction
    from launch.launch_description_sources import get_launch_description_from_python_launch_file

    context = LaunchContext()
    context.launch_configurations.update(given)
    found = []
    for entity in get_launch_description_from_python_launch_file(str(FILE)).entities:
        made = entity.execute(context)
        if isinstance(entity, OpaqueFunction):
            found = [node.node_executable for node in made]
    return found


@pytest.mark.parametrize(
    ('given', 'missing'),
    [
        ({}, set(DRIVERS)),
        ({'sensing': 'joints', 'views': 'true'}, {'merge_node'}),
        ({'merge': 'true'}, {'body_estimator_node', 'views_node'}),
        ({'simulate': 'false'}, {'simulator_node', 'body_estimator_node', 'views_node'}),
        ({'simulate': 'false', 'merge': 'false'}, {'simulator_node', *DRIVERS}),
        ({'views': 'true', 'record': 'false'}, {'recorder_node', 'merge_node', DRIVERS[0]}),
    ],
    ids=['simulated', 'joints', 'merge', 'robot', 'robot with records', 'not recorded'],
)
def test_it_starts_the_nodes_that_are_asked_for(given, missing):
    assert started(given) == [name for name in NODES if name not in missing]


def test_a_flag_that_is_neither_true_nor_false_is_refused():
    with pytest.raises(ValueError, match='perhaps'):
        started({'simulate': 'perhaps'})

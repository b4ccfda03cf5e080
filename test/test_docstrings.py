# SPDX-License-Identifier: Apache-2.0
"""Docstrings of the public names: complete, with units and errors; `test_docs` runs examples."""

import ast
import dataclasses
import doctest
import importlib
import inspect
import pathlib
import re
import textwrap

import pytest

from ros_pad.configuration import number
from ros_pad.errors import NoBridge

PARTS = 'contact capillary robots sensing estimation control regulators simulation bags trials'
PARTS += ' trials.sweep trials.recorded trials.replay errors'
PACKAGES = [f'ros_pad.{part}' for part in PARTS.split()]

UNIT = re.compile(
    r"(?<![\w/'-])(1/)?(m|mm|kg|N|Pa|J|s|ns|rad|Hz|nats)[²³]?(?![\w-])"
    r'|(?i:dimensionless|no unit|probabilit|ratio|factor|share|coefficient|quaternion|relative'
    r'|as for|stretch|transform)'
)
"""A unit, or a word for what has none."""

CHECKS = {'quantity', 'number', 'integer', 'text', 'choice', 'instance'}
"""Functions of ros_pad.configuration, which raise InvalidInput."""


def names_of(package: str) -> list[str]:
    """Return the public names of a package."""
    module = importlib.import_module(package)
    classes = [name for name, each in vars(module).items() if isinstance(each, type)]
    return getattr(module, '__all__', classes)


def function_of(member: object) -> object:
    """Return the function of a property or method."""
    for name in ('fget', 'func', '__func__'):
        member = getattr(member, name, None) or member
    return member


def documented() -> dict[str, object]:
    """Return public classes and functions, public methods and properties, by full name."""
    found = {}
    for package in PACKAGES:
        for name in names_of(package):
            each = getattr(importlib.import_module(package), name)
            if inspect.isclass(each) or inspect.isfunction(each):
                found[f'{package}.{name}'] = each
            for member, value in vars(each).items() if inspect.isclass(each) else ():
                if not member.startswith('_') and inspect.isfunction(function_of(value)):
                    found[f'{package}.{name}.{member}'] = function_of(value)
    return found


DOCUMENTED = documented()


def sections(text: str) -> dict[str, str]:
    """Return the text of each section of a NumPy docstring; '' is what is before the first."""
    parts = ['', *re.split(r'(?m)^(\w+)\n-{3,}$', inspect.cleandoc(text))]
    return dict(zip(parts[::2], parts[1::2], strict=True))


def entries(section: str) -> dict[str, tuple[str, str]]:
    """Return type and description of each name in a section."""
    found = {}
    for entry in re.findall(r'(?m)^\S.*(?:\n(?: .*)?)*', section):
        head, _, text = entry.partition('\n')
        names, _, kind = head.partition(' : ')
        found |= {name.strip(' *'): (kind, text) for name in names.split(',')}
    return found


def unit_missing(kind: str, text: str) -> bool:
    """Return whether a number of this type is described without unit."""
    numbers = re.search(r'float|array(?! of (int|str|bool)|\[np.bool)', kind)
    return bool(numbers) and not UNIT.search(text)


def parameters(of: object) -> set[str]:
    """Return the names of the parameters of a function or class; none of errors and protocols."""
    if inspect.isclass(of) and (issubclass(of, Exception) or getattr(of, '_is_protocol', False)):
        return set()
    names = inspect.signature(of).parameters
    return {name for name in names if name not in ('self', 'cls') and not name.startswith('_')}


def raised(of: object) -> set[str]:
    """Return the errors that a function raises itself, or a class when an instance is made."""
    if inspect.isclass(of):
        if getattr(of, '_is_protocol', False):
            return set()
        makers = [vars(of)[n] for n in ('__init__', '__post_init__') if n in vars(of)]
        makers = [each for each in makers if '<string>' not in each.__code__.co_filename]
        return set().union(*map(raised, makers))
    found = set()
    for node in ast.walk(ast.parse(textwrap.dedent(inspect.getsource(of)))):
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
            found |= {'InvalidInput'} if node.func.id in CHECKS else set()
        if isinstance(node, ast.Raise) and isinstance(node.exc, ast.Call):
            name = ast.unparse(node.exc.func)
            found |= {name} if name[0].isupper() else set()
    return found


def faults(of: object) -> list[str]:
    """Return what is missing in the docstring of a class or function, or wrong."""
    if not of.__doc__:
        return ['no docstring']
    parts = sections(of.__doc__)
    described = entries(parts.get('Parameters', ''))
    attributes = entries(parts.get('Attributes', ''))
    texts = described | attributes
    found = [f'{name}: no unit' for name, entry in texts.items() if unit_missing(*entry)]
    joined = re.findall(r'(?m)^\w+, .* : ', parts.get('Attributes', ''))
    found += [f'{heads}one entry for each attribute' for heads in joined]
    is_record = dataclasses.is_dataclass(of) or hasattr(of, '_fields')
    given = set(texts if is_record else described)
    wanted = parameters(of)
    found += [f'{name}: not documented' for name in wanted - given]
    found += [f'{name}: no such parameter' for name in set(described) - wanted]
    if not inspect.isclass(of):
        result = str(inspect.signature(of).return_annotation)
        given = entries(parts.get('Returns', '')) or {result.lower(): ('', parts[''])}
        found += [
            'result: no unit' for kind, (_, text) in given.items() if unit_missing(kind, text)
        ]
        named = result == 'None' or '.' in of.__qualname__ or 'Returns' in parts
        found += [] if named else ['no Returns']
    promised = parts.get('Raises', '')
    found += [f'{name}: not in Raises' for name in raised(of) if not re.search(name, promised)]
    return found


@pytest.mark.parametrize('name', DOCUMENTED)
def test_the_docstring_is_complete(name: str):
    assert not faults(DOCUMENTED[name])


def constants() -> dict[str, str]:
    """Return the package of each public name that is no class or function."""
    found = {}
    for package in PACKAGES:
        module = importlib.import_module(package)
        found |= {name: package for name in names_of(package) if not callable(vars(module)[name])}
    return found


@pytest.mark.parametrize(('name', 'package'), constants().items())
def test_what_a_constant_is_stands_below_it(name: str, package: str):
    folder = pathlib.Path(importlib.import_module(package).__file__).parent
    assignment = rf'(?m)^{name}\b[^=\n]*= (.+\n)(?:[ )}}].*\n)*(?="""[A-Z])'
    assert any(re.search(assignment, each.read_text('utf-8')) for each in folder.glob('*.py'))


WITH_EXAMPLES = (
    'inflate press force_limit pressure_for contact_angle meniscus bridge pads_in rise_height'
    ' tangential_resistance Pad.of squeeze wet bath_meniscus FootEstimator BodyEstimator'
    ' MorphologyController Scene.load Robot.load run create SimulatedRegulator BagReader'
    ' PneumaticChannel'
)


@pytest.mark.parametrize('name', WITH_EXAMPLES.split())
def test_the_main_names_have_an_example(name: str):
    found = next(each for full, each in DOCUMENTED.items() if full.endswith(f'.{name}'))
    assert doctest.DocTestParser().get_examples(found.__doc__)


def undocumented_length(length: float, *, mass: float = 1.0) -> float:
    """Return a length.

    Parameters
    ----------
    length : float
        Length of it.
    width : float
        Width, m.
    """
    raise NoBridge(number('length', length, 'm'))


def test_faults_of_a_docstring_are_found():
    assert set(faults(undocumented_length)) == {
        'length: no unit',
        'mass: not documented',
        'width: no such parameter',
        'result: no unit',
        'no Returns',
        'NoBridge: not in Raises',
        'InvalidInput: not in Raises',
    }

# SPDX-License-Identifier: Apache-2.0
"""Docstrings of the public names: complete, with units and errors; `test_docs` runs examples."""

import ast
import dataclasses
import importlib
import inspect
import re
import textwrap

import pytest

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


def names_of(package):
    """Return the public names of a package."""
    module = importlib.import_module(package)
    classes = [name for name, each in vars(module).items() if isinstance(each, type)]
    return getattr(module, '__all__', classes)


def function_of(member):
    """Return the function of a property or method."""
    for name in ('fget', 'func', '__func__'):
        member = getattr(member, name, None) or member
    return member


def documented():
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


def sections(text):
    """Return the text of each section of a NumPy docstring; '' is what is before the first."""
    parts = ['', *re.split(r'(?m)^(\w+)\n-{3,}$', inspect.cleandoc(text))]
    return dict(zip(parts[::2], parts[1::2], strict=True))


def entries(section):
    """Return type and description of each name in a section."""
    found = {}
    for entry in re.findall(r'(?m)^\S.*(?:\n(?: .*)?)*', section):
        head, _, text = entry.partition('\n')
        names, _, kind = head.partition(' : ')
        found |= {name.strip(' *'): (kind, text) for name in names.split(',')}
    return found


def unit_missing(kind, text):
    """Return whether a number of this type is described without unit."""
    numbers = re.search(r'float|array(?! of (int|str|bool)|\[np.bool)', kind)
    return bool(numbers) and not UNIT.search(text)


def parameters(of):
    """Return the names of the parameters of a function or class; none of errors and protocols."""
    if inspect.isclass(of) and (issubclass(of, Exception) or getattr(of, '_is_protocol', False)):
        return set()
    names = inspect.signature(of).parameters
    return {name for name in names if name not in ('self', 'cls') and not name.startswith('_')}


def raised(of):
    """Return the errors that a function raises itself."""
    found = set()
    for node in ast.walk(ast.parse(textwrap.dedent(inspect.getsource(of)))):
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
            found |= {'InvalidInput'} if node.func.id in CHECKS else set()
        if isinstance(node, ast.Raise) and isinstance(node.exc, ast.Call):
            name = ast.unparse(node.exc.func)
            found |= {name} if name[0].isupper() else set()
    return found


def faults(of):
    """Return what is missing in the docstring of a class or function, or wrong."""
    if not of.__doc__:
        return ['no docstring']
    parts = sections(of.__doc__)
    described = entries(parts.get('Parameters', ''))
    texts = described | entries(parts.get('Attributes', ''))
    found = [f'{name}: no unit' for name, entry in texts.items() if unit_missing(*entry)]
    is_record = dataclasses.is_dataclass(of) or hasattr(of, '_fields')
    wanted = parameters(of)
    found += [f'{n}: not documented' for n in wanted - set(texts if is_record else described)]
    found += [f'{name}: no such parameter' for name in set(described) - wanted]
    if not inspect.isclass(of):
        result = str(inspect.signature(of).return_annotation)
        given = entries(parts.get('Returns', '')) or {result.lower(): ('', parts[''])}
        found += [
            'result: no unit' for kind, (_, text) in given.items() if unit_missing(kind, text)
        ]
        promised = parts.get('Raises', '')
        found += [f'{n}: not in Raises' for n in raised(of) if not re.search(n, promised)]
    return found


# A third of the names, another one for each number of names.
@pytest.mark.parametrize('name', sorted(DOCUMENTED)[len(DOCUMENTED) % 3 :: 3])
def test_the_docstring_is_complete(name):
    assert not faults(DOCUMENTED[name])

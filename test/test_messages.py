# SPDX-License-Identifier: Apache-2.0
"""The form of the texts of all errors, as far as a program can judge it."""

from __future__ import annotations

import ast
import functools
import pathlib
import re

PACKAGE = pathlib.Path(__file__).parent.parent / 'ros_pad'
ERRORS = {'InvalidInput', 'ConfigError', 'PadError', 'BagError', 'MeshError', 'LimitError'}


@functools.cache
def raised():
    """Return place and text of each error of ros_pad that is raised with a text."""
    found = []
    for path in sorted(PACKAGE.rglob('*.py')):
        for node in ast.walk(ast.parse(path.read_text(encoding='utf-8'))):
            call = node.exc if isinstance(node, ast.Raise) else None
            if isinstance(call, ast.Call) and getattr(call.func, 'id', '') in ERRORS:
                found.append((f'{path.relative_to(PACKAGE)}:{node.lineno}', call.args[0]))
    return found


def words(text):
    """Return a text with {} in place of its values."""
    if isinstance(text, ast.JoinedStr):
        return ''.join(words(part) for part in text.values)
    return str(text.value) if isinstance(text, ast.Constant) else '{}'


def test_texts_name_values_and_what_is_needed():
    assert len(raised()) > 100
    for place, text in raised():
        said = words(text)
        assert said == said.strip(), f'{place}: {said}'
        # "x = 3 is not allowed" is followed by what is.
        assert not re.search(r'= \{\}[^:]* is not allowed$', said), f'{place}: {said}'
        if 'is not allowed:' in said:
            assert re.search(r'\{\}|--|=', said), f'{place}: no value in {said}'

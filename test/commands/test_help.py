# SPDX-License-Identifier: Apache-2.0
"""``pad --help`` and ``pad COMMAND --help`` have examples that work, and units."""

import argparse
import json
import re
import shlex

import pytest
from shared import python

from ros_pad import cli

# The help of an option with a number has its unit, or shows that it counts or names something.
UNITS = re.compile(
    r"(?<![\w.'])(Pa|kPa|N|N/m|m|m²|kg/m³|s|Pa s|Hz|rad|degrees)(?![\w/])"
    r'|how many|number|cycles|processes|figures of these|seed|of floor and noise|factor'
)


@pytest.mark.parametrize('command', cli.COMMANDS)
def test_examples_parse_and_numbers_have_units(command):
    # argparse has no public names for the arguments and commands of a parser.
    actions = cli.parser(command)._actions
    (commands,) = (each for each in actions if isinstance(each, argparse._SubParsersAction))
    part = commands.choices[command]
    lines = part.format_help().replace('\\\n', ' ').splitlines()
    found = [shlex.split(line) for line in lines if line.startswith('  pad ')]
    assert found
    for words in found:
        assert words[:2] == ['pad', command]
        assert callable(cli.parser(command).parse_args(words[1:]).command)
    for each in part._actions:
        assert each.help, each.dest
        assert each.type not in (int, float) or UNITS.search(each.help), each.dest


def test_pad_help_names_commands_and_imports_none_of_them():
    text = ' '.join(cli.parser().format_help().split())
    for command, summary in cli.COMMANDS.items():
        assert f' {command} ' in text and summary in text
    code = 'import sys; from ros_pad import cli; cli.parser(); print(sorted(sys.modules))'
    modules = json.loads(python('-c', code).stdout.replace("'", '"'))
    # Importing these takes time: a second, with all of the commands.
    assert not {'numpy', 'scipy', 'matplotlib', 'mcap'} & set(modules)

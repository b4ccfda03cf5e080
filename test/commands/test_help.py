# SPDX-License-Identifier: Apache-2.0
"""``pad --help`` and ``pad COMMAND --help`` have examples that work, and units."""

import argparse
import re
import shlex

import pytest

from ros_pad import cli

# The help of an option with a number has its unit, or shows that it counts or names something.
UNITS = re.compile(r"(?<![\w.'])(Pa|kPa|N|N/m|m|m²|kg/m³|s|Pa s|Hz|rad|degrees)(?![\w/])")
COUNTS = re.compile(
    r'how many|number|cycles|processes|figures of these|seed|of floor and noise|factor'
)


# argparse has no public names for the arguments and commands of a parser.
def command_parser(command: str) -> argparse.ArgumentParser:
    (commands,) = (
        each
        for each in cli.parser(command)._actions
        if isinstance(each, argparse._SubParsersAction)
    )
    return commands.choices[command]


def examples(text: str) -> list[list[str]]:
    """Return the words of each command in a text; a backslash continues a line."""
    lines = text.replace('\\\n', ' ').splitlines()
    return [shlex.split(line) for line in lines if line.startswith('  pad ')]


def test_the_modules_of_commands_are_the_commands():
    from ros_pad import commands

    (folder,) = commands.__path__
    import pathlib

    adding = {
        path.stem
        for path in pathlib.Path(folder).glob('*.py')
        if '\ndef add(' in path.read_text(encoding='utf-8')
    }
    assert adding == set(cli.COMMANDS)


@pytest.mark.parametrize('command', cli.COMMANDS)
def test_examples_parse(command: str):
    found = examples(command_parser(command).format_help())
    assert found
    for words in found:
        assert words[:2] == ['pad', command]
        options = cli.parser(command).parse_args(words[1:])  # exits on a wrong option
        assert callable(options.command)


def test_the_example_of_pad_parses():
    ((_, *words),) = examples(cli.parser().format_help())
    assert cli.parser(words[0]).parse_args(words)


@pytest.mark.parametrize('command', cli.COMMANDS)
def test_numbers_have_their_unit_in_the_help(command: str):
    numbers = [
        each for each in command_parser(command)._actions if each.type in (int, float)
    ]  # fmt: skip
    for each in numbers:
        assert UNITS.search(each.help) or COUNTS.search(each.help), (
            f'pad {command}: no unit in the help of {each.dest}'
        )
    for each in command_parser(command)._actions:
        assert each.help, f'pad {command}: {each.dest} has no help'


def test_pad_help_names_commands_and_exit_statuses():
    text = cli.parser().format_help()
    for command, summary in cli.COMMANDS.items():
        assert f' {command} ' in text.replace('\n', ' ')
        assert summary in ' '.join(text.split())
    for status in ('0    done', '1    a failure', '2    bad usage', '130  stopped'):
        assert f'  {status}' in text

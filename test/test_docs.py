# SPDX-License-Identifier: Apache-2.0
"""Links, files, imports and commands on every page exist; examples run."""

from __future__ import annotations

import ast
import doctest
import importlib
import importlib.util
import itertools
import pathlib
import re
import shlex
import shutil
import urllib.parse

import pytest

from ros_pad import cli, configuration
from studies.__main__ import STUDIES

ROOT = pathlib.Path(__file__).resolve().parent.parent
PAGES = [
    *sorted(ROOT.glob('*.md')),
    *sorted(ROOT.glob('bags/*.md')),
    *sorted(ROOT.glob('docs/**/*.md')),
]
FENCE = re.compile(r'^ *```(\S*)\n(.*?)^ *```$', re.DOTALL | re.MULTILINE)
EXAMPLE = re.compile(rf'(?:^ *<!-- example: ([^>]*) -->\n)?{FENCE.pattern}', FENCE.flags)
COMMAND = re.compile(
    r'(?:pad (?!of )|(?:python3?|pip|ros2|make|sudo|sed|export|cd|rm|\.|dask|rviz2|\w+_node) )'
)
LINK = re.compile(r'\]\(([^)\s]+)\)')
SOURCES = ('ros_pad', 'studies', 'test', 'config', 'launch')
PAGE_NAME = re.compile(r'\bdocs/[\w/.-]+\.(?:md|json|png)')

MODULES = sorted(
    '.'.join(path.relative_to(ROOT).with_suffix('').parts).removesuffix('.__init__')
    for path in (ROOT / 'ros_pad').rglob('*.py')
    if '>>> ' in path.read_text(encoding='utf-8')
)


def names(pages):
    return [str(page.relative_to(ROOT)) for page in pages]


def prose(page):
    """Return a page without its code blocks."""
    return FENCE.sub('', page.read_text(encoding='utf-8'))


def anchors(page):
    """Return the anchors of a page's headings, as GitHub makes them."""
    found: set[str] = set()
    for heading in re.findall(r'^#+ (.*)$', prose(page), re.MULTILINE):
        text = re.sub(r'\[([^]]*)\]\([^)]*\)', r'\1', heading)
        slug = re.sub(r'[^\w -]', '', text.lower()).replace(' ', '-')
        count = sum(
            each == slug or re.fullmatch(rf'{re.escape(slug)}-\d+', each) is not None
            for each in found
        )
        found.add(f'{slug}-{count}' if count else slug)
    return found


@pytest.mark.parametrize('page', PAGES, ids=names(PAGES))
def test_every_relative_link_and_anchor_resolves(page):
    for link in LINK.findall(prose(page)):
        if re.match(r'\w+:', link):
            continue
        path, _, anchor = urllib.parse.unquote(link).partition('#')
        target = (page.parent / path).resolve() if path else page
        assert target.exists(), link
        assert target.is_relative_to(ROOT), link
        if anchor:
            assert anchor in anchors(target), link


def test_every_page_can_be_reached_from_the_readme():
    reached, found = set(), [ROOT / 'README.md']
    while found:
        page = found.pop()
        if page in reached:
            continue
        reached.add(page)
        links = (link.partition('#')[0] for link in LINK.findall(prose(page)))
        found += [
            (page.parent / link).resolve()
            for link in links
            if link.endswith('.md') and ':' not in link
        ]
    assert set(PAGES) <= reached


def test_pages_that_code_names_exist():
    checked = 0
    for folder in SOURCES:
        for path in sorted((ROOT / folder).rglob('*')):
            if path.suffix in ('.py', '.yaml', '.xml'):
                for name in PAGE_NAME.findall(path.read_text(encoding='utf-8')):
                    assert (ROOT / name).exists(), f'{path.relative_to(ROOT)}: {name}'
                    checked += 1
    assert checked


def pad_commands(page):
    """Yield the words of every ``pad`` command in the shell blocks of a page."""
    for kind, block in FENCE.findall(page.read_text(encoding='utf-8')):
        if kind in ('', 'sh'):
            for line in block.replace('\\\n', ' ').splitlines():
                # Lines that begin with `pad of` are output, no commands.
                if re.match(r' *pad (?!of )\w', line):
                    yield shlex.split(line.partition(' && ')[0], comments=True)


@pytest.mark.parametrize('page', PAGES, ids=names(PAGES))
def test_python_on_a_page_imports_what_exists(page):
    for kind, block in FENCE.findall(page.read_text(encoding='utf-8')):
        if kind == 'python':
            for node in ast.walk(ast.parse(block)):
                if isinstance(node, ast.ImportFrom) and node.module.startswith('ros_pad'):
                    for each in node.names:
                        module = importlib.import_module(node.module)
                        inner = f'{node.module}.{each.name}'
                        assert hasattr(module, each.name) or importlib.util.find_spec(inner)


@pytest.mark.parametrize('page', PAGES, ids=names(PAGES))
def test_files_and_studies_named_on_a_page_exist(page):
    text = page.read_text(encoding='utf-8')
    for name in re.findall(r'`((?:ros_pad|studies|test|config)/[^` *<]*)`', text):
        parts = [part.split(',') for part in re.split(r'[{}]', name)]
        for path in map(''.join, itertools.product(*parts)):
            assert (ROOT / path).exists(), path
    for name in re.findall(r'python -m\s+studies\s+([a-z]\w*)', text):
        assert name in STUDIES


@pytest.mark.parametrize('page', PAGES, ids=names(PAGES))
def test_every_command_is_understood(page):
    for _, *words in pad_commands(page):
        assert callable(cli.parser(words[0]).parse_args(words).command)


def test_the_pages_list_every_command_study_and_scene():
    commands = (ROOT / 'docs' / 'commands.md').read_text(encoding='utf-8')
    for command in cli.COMMANDS:
        assert f'`pad {command}' in commands
    for study in STUDIES:
        assert f'`{study}`' in commands
    scenes = (ROOT / 'docs' / 'scenes.md').read_text(encoding='utf-8')
    for name in configuration.names('scenes'):
        assert f'`{name}`' in scenes


def commands(block):
    """Return the commands in a block of a shell; a block of output has none."""
    lines = block.replace('\\\n', ' ').splitlines()
    return [line.strip() for line in lines if COMMAND.match(line.strip())]


def examples(page):
    """Return reason, kind and text of each example on a page."""
    found = EXAMPLE.findall(page.read_text(encoding='utf-8'))
    return [
        each
        for each in found
        if each[1] == 'python' or (each[1] in ('', 'sh') and commands(each[2]))
    ]


WITH_EXAMPLES = [page for page in PAGES if any(not each[0] for each in examples(page))]


@pytest.mark.parametrize('name', MODULES)
def test_examples_of_docstrings(name):
    failed, tried = doctest.testmod(importlib.import_module(name))
    assert tried
    assert not failed


@pytest.mark.slow
@pytest.mark.parametrize('page', WITH_EXAMPLES, ids=names(WITH_EXAMPLES))
def test_examples_of_pages(page, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    shutil.copytree(ROOT / 'bags', tmp_path / 'bags')
    shutil.copy(ROOT / 'config' / 'measurements' / 'thesis.csv', 'my_pads.csv')
    known: dict[str, object] = {'__name__': '__main__'}
    for reason, kind, text in examples(page):
        if kind == 'python' and not reason:
            exec(compile(text, str(page), 'exec'), known)
        # CI runs make and installs with colcon, as the README describes.
        elif not reason and page != ROOT / 'README.md':
            for line in commands(text):
                program, *words = shlex.split(line, comments=True)
                assert program == 'pad', f'neither run nor marked: {line}'
                different = words[0] == 'replay' and '--set' in words
                assert cli.main(words) == different, line


def test_reasons_for_examples_that_are_not_run_here():
    """``pytest -rP`` lists them."""
    tutorials = (ROOT / 'test' / 'test_tutorials.py').read_text(encoding='utf-8')
    for page in PAGES:
        for reason, _, text in examples(page):
            if reason:
                print(f'{page.relative_to(ROOT)}: {text.splitlines()[0]}: {reason}')
                assert re.match('(run by|not run:) .', reason)
                by = reason.removeprefix('run by ')
                if by != reason:
                    assert f'def {by}(' in tutorials or (ROOT / 'test' / by).is_file()

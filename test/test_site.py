# SPDX-License-Identifier: Apache-2.0
"""The site: it builds without a warning, has every name, and fits a narrow screen."""

import importlib
import os
import pathlib
import re
import subprocess
import sys

import pytest

from ros_pad import cli
from studies.__main__ import STUDIES

pytest.importorskip('furo', reason='pip install "ros_pad[docs]"')
inventory = pytest.importorskip('sphinx.util.inventory')

ROOT = pathlib.Path(__file__).resolve().parent.parent
DOCS = ROOT / 'docs'
PACKAGES = sorted(page.stem for page in (DOCS / 'api').glob('*.md') if page.stem != 'README')


@pytest.fixture(scope='module')
def site(tmp_path_factory):
    """Return the folder of the site, which `make docs` has built just before."""
    if 'SITE' in os.environ:
        return ROOT / os.environ['SITE']
    folder = tmp_path_factory.mktemp('site')
    words = ['-m', 'sphinx', '-q', '-E', '-W', '--keep-going', str(DOCS), str(folder)]
    built = subprocess.run([sys.executable, *words], capture_output=True, text=True)
    assert built.returncode == 0, built.stderr
    return folder


@pytest.mark.slow
def test_every_public_name_has_an_entry(site):
    data = inventory.InventoryFile.loads((site / 'objects.inv').read_bytes(), uri='').data
    entries = {name for kind, names in data.items() if kind.startswith('py:') for name in names}
    for package in PACKAGES:
        module = importlib.import_module(f'ros_pad.{package}')
        for name in getattr(module, '__all__', ()):
            assert f'ros_pad.{package}.{name}' in entries


@pytest.mark.slow
def test_every_command_is_described(site):
    text = (site / 'options.html').read_text(encoding='utf-8')
    for command in cli.COMMANDS:
        assert f'usage: pad {command}' in re.sub('<[^>]*>', '', text)


def test_gallery_and_examples_show_every_chart_and_how_it_is_made():
    text = (DOCS / 'gallery.md').read_text(encoding='utf-8')
    shown = re.findall(r'^!\[.+\]\(charts/(.*)\.png\)\n\n((?:.+\n)+)', text, re.MULTILINE)
    examples = re.findall(
        r'\(charts/(.*)\.png\)', (DOCS / 'examples.md').read_text(encoding='utf-8')
    )
    assert sorted([*(chart for chart, _ in shown), *examples]) == sorted(
        path.stem for path in (DOCS / 'charts').glob('*.png')
    )
    for chart, about in shown:
        program, *words = re.findall(r'`((?:pad|python) [^`]*)`', about)[0].split()
        (page,) = re.findall(r'\]\(([^)]*\.md)\)', about)
        assert (DOCS / page).exists()
        if program == 'pad':
            assert callable(cli.parser(words[0]).parse_args(words).command)
        else:
            assert words[:2] == ['-m', 'studies'] and words[2] in STUDIES, chart

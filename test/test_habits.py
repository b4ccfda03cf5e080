# SPDX-License-Identifier: Apache-2.0
"""What contributors and their tools read agrees with the package."""

from __future__ import annotations

import pathlib
import re
import xml.etree.ElementTree

import yaml

import ros_pad

ROOT = pathlib.Path(__file__).resolve().parent.parent
PACKAGE = xml.etree.ElementTree.parse(ROOT / 'package.xml').getroot()


def read(path):
    return yaml.safe_load(path.read_text(encoding='utf-8'))


def test_the_citation_is_of_this_version():
    citation = read(ROOT / 'CITATION.cff')
    assert str(citation['version']) == ros_pad.__version__
    assert citation['license'] == PACKAGE.findtext('license')
    assert [each['name'] for each in citation['authors']] == [PACKAGE.findtext('maintainer')]


def test_hooks_run_what_make_lint_runs():
    makefile = (ROOT / 'Makefile').read_text(encoding='utf-8')
    recipe = re.search(r'^lint:.*\n((?:\t.*\n)+)', makefile, re.MULTILINE)[1]
    linted = [line.strip().replace('$(BIN)', '.venv/bin') for line in recipe.splitlines()]
    (local,) = read(ROOT / '.pre-commit-config.yaml')['repos']
    assert local['repo'] == 'local'
    assert [hook['entry'] for hook in local['hooks']] == linted
    for hook in local['hooks']:
        assert (hook['language'], hook['pass_filenames']) == ('system', False)

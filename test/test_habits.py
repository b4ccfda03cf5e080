# SPDX-License-Identifier: Apache-2.0
"""What contributors and their tools read agrees with the package."""

from __future__ import annotations

import pathlib
import re
import subprocess
import xml.etree.ElementTree

import pytest
import yaml

import ros_pad

ROOT = pathlib.Path(__file__).resolve().parent.parent
PACKAGE = xml.etree.ElementTree.parse(ROOT / 'package.xml').getroot()
WORKFLOWS = sorted((ROOT / '.github' / 'workflows').glob('*.yml'))


def read(path):
    return yaml.safe_load(path.read_text(encoding='utf-8'))


def test_the_citation_is_of_this_version():
    citation = read(ROOT / 'CITATION.cff')
    assert str(citation['version']) == ros_pad.__version__
    assert citation['license'] == PACKAGE.findtext('license')
    assert [each['name'] for each in citation['authors']] == [PACKAGE.findtext('maintainer')]


def test_placeholders_are_in_package_xml_alone():
    names = subprocess.run(
        ['git', 'grep', '-lI', 'example' + r'\.org'], cwd=ROOT, capture_output=True, text=True
    )
    if names.returncode > 1:
        pytest.skip('not a checkout of the repository: there is no list of its files')
    assert set(names.stdout.split()) == {'package.xml', 'CONTRIBUTING.md'}


def test_hooks_run_what_make_lint_runs():
    makefile = (ROOT / 'Makefile').read_text(encoding='utf-8')
    recipe = re.search(r'^lint:.*\n((?:\t.*\n)+)', makefile, re.MULTILINE)[1]
    linted = [line.strip().replace('$(BIN)', '.venv/bin') for line in recipe.splitlines()]
    (local,) = read(ROOT / '.pre-commit-config.yaml')['repos']
    assert local['repo'] == 'local'
    assert [hook['entry'] for hook in local['hooks']] == linted
    for hook in local['hooks']:
        assert (hook['language'], hook['pass_filenames']) == ('system', False)


@pytest.mark.parametrize('path', WORKFLOWS, ids=lambda path: path.stem)
def test_workflows_may_only_read_and_name_major_versions(path):
    workflow = read(path)
    assert workflow['permissions'] == {'contents': 'read'}
    for job in workflow['jobs'].values():
        assert job['runs-on'] == 'ubuntu-24.04'  # the home of Jazzy
        assert job['timeout-minutes'] <= 60
        assert 'permissions' not in job
        for step in job['steps']:
            if 'uses' in step:
                assert re.fullmatch(r'actions/[\w-]+@v\d+', step['uses'])

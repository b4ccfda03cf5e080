# SPDX-License-Identifier: Apache-2.0
"""The citation agrees with the package."""

import pathlib
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

# SPDX-License-Identifier: Apache-2.0
"""Verdicts on the statements of the thesis that docs/charts/thesis.json has."""

import json

import pytest

from studies import command


@pytest.fixture(scope='session')
def kept():
    return json.loads((command.CHARTS / 'thesis.json').read_text(encoding='utf-8'))


@pytest.fixture(scope='session')
def verdict_in_docs(kept):
    """Return verdicts by section, figure and statement."""
    return {(claim['where'], claim['thesis']): claim['verdict'] for claim in kept['claims']}


@pytest.fixture(scope='session')
def agree(verdict_in_docs):
    """Return a function that compares statements with those in the docs; at least one."""

    def compare(claims):
        found = {(claim.where, claim.thesis): claim.verdict for claim in claims}
        assert found
        assert found == {key: verdict_in_docs.get(key) for key in found}

    return compare

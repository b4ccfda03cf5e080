# SPDX-License-Identifier: Apache-2.0
"""Every statement of the thesis has a verdict, and docs show the ones that were computed."""

import dataclasses
import math

import pytest

from studies.thesis import statements, verdicts
from studies.thesis.explained import VERDICTS, Claim

CLAIMS = statements.claims()
CLAIM = Claim(figure=20, thesis='more', ours='less', numbers=(1.0,), holds=True, section='3.2.2')


@pytest.mark.parametrize(
    'changes, verdict',
    [
        ({}, 'agrees'),
        ({'tuned': 'friction'}, 'agrees, tuned'),
        ({'same': True}, 'same formula'),
        ({'same': True, 'holds': False}, 'our model disagrees'),
        ({'tuned': 'friction', 'holds': False}, 'our model disagrees'),
        ({'fails': 'misprint', 'holds': False}, 'misprint'),
        ({'fails': 'error in a derivation'}, 'agrees'),
        ({'holds': None, 'missing': 'loads'}, 'underdetermined'),
        ({'holds': None}, 'not modelled'),
    ],
)
def test_verdict(changes, verdict):
    assert dataclasses.replace(CLAIM, **changes).verdict == verdict


def test_the_pages_show_what_the_study_wrote(kept):
    for page, table in verdicts.tables(kept):
        text = page.read_text(encoding='utf-8')
        assert text.partition(verdicts.MARK)[2] == '\n' + table


def test_no_measurement_is_judged(kept):
    """What can be checked is an equation or a word of the text, never a figure of experiments."""
    for claim in kept['claims']:
        if claim['verdict'] in ('misprint', 'error in a derivation'):
            assert claim['figure'] in (0, 10, 27, 31), claim['thesis']


def test_every_figure_is_judged_and_every_verdict_has_its_reason(kept):
    claims = kept['claims']
    needed = {10, *range(14, 19), 20, 21, *range(26, 32), 33, 34, 38, 39, *range(41, 45)}
    assert {claim['figure'] for claim in claims} == needed | {0}
    assert len(claims) == len({(claim['where'], claim['thesis']) for claim in claims})
    for claim in claims:
        assert claim['verdict'] in VERDICTS and claim['thesis'] and claim['ours']
        assert '|' not in claim['thesis'] + claim['ours'] + claim['reason']
        assert claim['see'] and claim['why'] and not claim['why'].strip('.').count('. ') > 1
        assert (claim['verdict'] == 'underdetermined') == bool(claim['missing'])


def test_statements_without_a_figure_have_the_verdicts_of_the_docs(agree, kept):
    agree(CLAIMS)
    assert len(CLAIMS) == sum(claim['figure'] == 0 for claim in kept['claims'])


def named(words):
    (claim,) = (claim for claim in CLAIMS if words in claim.thesis)
    return claim


def test_numbers_of_statements_by_hand():
    """Height to 30 digits elsewhere; P = 4 sin t − 2 sin 2t is 2.8125; the rest is geometry."""
    right, height = named('tension times its area').numbers
    assert height == pytest.approx(1.9412681941617884e-3, rel=1e-12)
    t = math.atan(right / 1.5e-3)
    assert 4.0 * math.sin(t) - 2.0 * math.sin(2.0 * t) == pytest.approx(2.8125, rel=1e-12)
    assert named('Number of pads').numbers[0] == pytest.approx(
        4.5 * math.sqrt(3.0) / (math.pi / 3.0 + math.sqrt(3.0))
    )
    assert named('Pressure for R').numbers[0] == pytest.approx(
        4.3 / (math.sqrt(18.0 + 6.0 * math.sqrt(5.0)) - 4.0 / 3.0)
    )
    assert named('Strain is assumed').numbers[0] == pytest.approx(math.sqrt(6.25 / 2.25))

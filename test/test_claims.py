# SPDX-License-Identifier: Apache-2.0
"""Every figure of the README and of the front pages is in a file that a study wrote."""

import json
import pathlib
import re

import pytest
import yaml

ROOT = pathlib.Path(__file__).resolve().parent.parent
CLAIMS = yaml.safe_load((ROOT / 'docs' / 'claims.yaml').read_text(encoding='utf-8'))
PAGES = 'README.md', 'docs/index.md', 'docs/gallery.md'


def flat(text):
    return ' '.join(text.split())


def names():
    """Return what expressions may use."""
    charts = {
        path.stem: json.loads(path.read_text(encoding='utf-8'))
        for path in (ROOT / 'docs' / 'charts').glob('*.json')
    }
    functions = (abs, any, int, len, max, min, round, sum, zip)
    return charts | {'__builtins__': {function.__name__: function for function in functions}}


def shown(claim):
    """Return the text of a claim with its figures."""
    known = names()
    for name, expression in claim.get('let', {}).items():
        known[name] = eval(expression, known)
    assert eval(str(claim.get('must', True)), known), claim['must']
    values = [eval(str(value), known) for value in claim['values']]
    return flat(claim['text'].format(*values))


def unwired(page, claims):
    """Return a page without the figures of claims and the texts that are no claims."""
    text = flat((ROOT / page).read_text(encoding='utf-8'))
    for claim in claims['claims'] if page == PAGES[0] else ():
        assert shown(claim) in text, f'{page} has not: {shown(claim)}'
        text = text.replace(shown(claim), re.sub(r'\{[^}]*\}', '', flat(claim['text'])))
    for words in claims['no_claims'][page]:
        assert words in text, f'docs/claims.yaml: no_claims: {words!r} is not on {page}'
        text = text.replace(words, '')
    return text


@pytest.mark.parametrize('page', PAGES)
def test_every_number_of_the_page_is_wired(page):
    text = re.sub(r'\]\([^)]*\)', ']', unwired(page, CLAIMS))  # targets of links
    text = re.sub(r'`(pad|python) [^`]*`', '', text)  # commands
    left = re.findall(r'.{0,30}\d.{0,30}', text)
    assert not left, f'neither a claim nor a no_claim of docs/claims.yaml: {left}'


def test_every_claim_says_how_it_was_got():
    for claim in CLAIMS['claims']:
        assert {'from', 'sample', 'interval', 'how', 'command'} <= claim.keys(), claim['text']
        assert (ROOT / claim['from']).is_file()
        assert claim['command'].startswith(('pad ', 'python -m studies '))
        assert '{' in claim['text'] or claim['must']

# SPDX-License-Identifier: Apache-2.0
"""Every figure of the README is in a file that a study wrote (docs/claims.yaml)."""

import json
import math
import pathlib
import re

import yaml

ROOT = pathlib.Path(__file__).resolve().parent.parent
CLAIMS = yaml.safe_load((ROOT / 'docs' / 'claims.yaml').read_text(encoding='utf-8'))
WORDS = dict(enumerate(('two', 'three', 'four', 'five', 'six'), start=2)) | {12: 'twelve'}


def flat(text):
    return ' '.join(text.split())


def names():
    """Return what expressions may use."""
    charts = {
        path.stem: json.loads(path.read_text(encoding='utf-8'))
        for path in (ROOT / 'docs' / 'charts').glob('*.json')
    }
    functions = (abs, any, int, len, max, min, round, sum, zip)
    return charts | {
        '__builtins__': {function.__name__: function for function in functions},
        'log10': math.log10,
        'word': lambda number: WORDS.get(number, str(number)),
        'config': lambda path: yaml.safe_load((ROOT / 'config' / path).read_text()),
    }


def shown(claim):
    """Return the text of a claim with its figures."""
    known = names()
    for name, expression in claim.get('let', {}).items():
        known[name] = eval(expression, known)
    assert eval(str(claim.get('must', True)), known), claim['must']
    values = [eval(str(value), known) for value in claim['values']]
    return flat(claim['text'].format(*values))


def unwired(readme, claims):
    """Return the README without the figures of claims and the texts that are no claims."""
    text = flat(readme)
    for claim in claims['claims']:
        assert shown(claim) in text, f'the README has not: {shown(claim)}'
        text = text.replace(shown(claim), re.sub(r'\{[^}]*\}', '', flat(claim['text'])))
    for words in claims['no_claims']:
        assert words in text, f'docs/claims.yaml: no_claims: {words!r} is not in the README'
        text = text.replace(words, '')
    return text


def test_every_number_of_the_readme_is_wired():
    text = unwired((ROOT / 'README.md').read_text(encoding='utf-8'), CLAIMS)
    text = re.sub(r'\]\([^)]*\)', ']', text)  # targets of links
    left = re.findall(r'.{0,30}\d.{0,30}', text)
    assert not left, f'neither a claim nor a no_claim of docs/claims.yaml: {left}'


def test_every_claim_says_how_it_was_got():
    for claim in CLAIMS['claims']:
        assert claim['how'] and claim['command']
        assert claim['command'].startswith(('pad ', 'python -m studies '))
        assert '{' in claim['text'] or claim['must']

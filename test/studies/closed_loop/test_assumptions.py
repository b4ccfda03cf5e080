# SPDX-License-Identifier: Apache-2.0
"""docs/assumptions.md and settings_assumed.md list every assumed number, with the right values."""

from __future__ import annotations

import dataclasses
import fnmatch
import importlib
import inspect
import itertools
import json
import pathlib
import re
from typing import NamedTuple

import pytest
import yaml

from ros_pad.trials import run
from studies.closed_loop import assumptions, policies

ROOT = pathlib.Path(__file__).resolve().parents[3]
PAGE = ROOT / 'docs' / 'assumptions.md'
PAGES = (PAGE, ROOT / 'docs' / 'settings_assumed.md')
DOCUMENT = ROOT / 'docs' / 'charts' / 'assumptions.json'
FILES = sorted(
    path
    for kind in ('feet', 'materials', 'robots', 'scenes')
    for path in ROOT.glob(f'config/{kind}/*.yaml')
)
STATUSES = ('thesis', 'measured', 'data', 'derived', 'assumed', 'chosen')

# Classes and functions, by module, with numeric defaults that the thesis does not give.
TUNED = {
    'estimation/tuning.py': ('Tuning',),
    'estimation/friction.py': ('GroundModel',),
    'control/morphology.py': ('MorphologyController',),
    'control/policies.py': ('adaptive',),
    'regulators/simulated.py': ('SimulatedRegulator',),
}


class Row(NamedTuple):
    """One row of the page's tables."""

    value: str
    pattern: str
    key: str
    status: str
    halved: str | None
    doubled: str | None

    @property
    def number(self):
        return float(re.match(r'[-+0-9.e]+|inf', self.value)[0])


def rows():
    """Return the rows of every table with a column ``where``, on both pages."""
    found = []
    header: list[str] = []
    for line in itertools.chain(
        *(page.read_text(encoding='utf-8').splitlines() for page in PAGES)
    ):
        if not line.startswith('|'):
            header = []
            continue
        cells = [cell.strip() for cell in line.strip('|').split('|')]
        if not header:
            header = cells
        elif 'where' in header and not set(line) <= set('|-: '):
            named = dict(zip(header, cells, strict=True))
            pattern, key = named['where'].strip('`').split(': ')
            found.append(
                Row(
                    named['value'], pattern, key, named['status'],
                    named.get('halved'), named.get('doubled'),
                )
            )  # fmt: skip
    return found


ROWS = rows()


def numbers(table, path=''):
    """Yield the dotted key and the value of every number in a YAML file, but for geometry."""
    for key, value in table.items():
        if key in ('legs', 'imu') or isinstance(value, (bool, list)):
            continue
        if isinstance(value, dict):
            yield from numbers(value, f'{path}{key}.')
        else:
            try:
                yield f'{path}{key}', float(value)
            except ValueError:
                assert isinstance(value, str)


def defaults(module, name):
    """Return the numeric defaults of a class or function of ros_pad."""
    part = importlib.import_module('ros_pad.' + module.removesuffix('.py').replace('/', '.'))
    parameters = inspect.signature(getattr(part, name)).parameters.values()
    return {
        p.name: float(p.default)
        for p in parameters
        if isinstance(p.default, (int, float)) and not isinstance(p.default, bool)
    }


@pytest.fixture(scope='module')
def document():
    return json.loads(DOCUMENT.read_text(encoding='utf-8'))


def test_the_page_has_rows_and_known_statuses():
    assert len(ROWS) > 60
    for row in ROWS:
        assert row.status.split()[0].strip(',:;') in STATUSES, row


def comment(text, key):
    """Whether the line of a key, or that of the table that it is in, has a comment."""
    return any(re.search(rf'^ *{name}:.*#', text, re.MULTILINE) for name in key.split('.')[-2:])


@pytest.mark.parametrize('path', FILES, ids=lambda path: f'{path.parent.name}/{path.stem}')
def test_every_number_of_a_file_is_on_the_page_or_has_its_source_there(path):
    name, text = f'{path.parent.name}/{path.name}', path.read_text(encoding='utf-8')
    table = yaml.safe_load(text)
    found = dict(numbers(table))
    assert found
    for key, value in found.items():
        quoted = [r.number for r in ROWS if r.key == key and fnmatch.fnmatch(name, r.pattern)]
        assert quoted or 'source' in table or comment(text, key), f'{name}: {key} = {value}'
        assert quoted == [pytest.approx(value, rel=1e-12)] * len(quoted), f'{name}: {key}'


def test_no_row_is_about_a_key_that_is_gone():
    files = {f'{path.parent.name}/{path.name}': path for path in FILES}
    for row in ROWS:
        if row.pattern.endswith('.yaml'):
            matches = fnmatch.filter(files, row.pattern)
            keys = [dict(numbers(yaml.safe_load(files[m].read_text()))) for m in matches]
            assert any(row.key in found for found in keys), row


@pytest.mark.parametrize(
    ('module', 'name'), [(module, name) for module, names in TUNED.items() for name in names]
)
def test_every_default_is_on_the_page(module, name):
    found = defaults(module, name)
    assert found
    quoted = {r.key.removeprefix(f'{name}.'): r.number for r in ROWS if r.pattern == module}
    # Seed and values that every scene gives are no assumptions of the code.
    for key in found.keys() - {'seed', 'hose_diameter', 'hose_length', 'pad_volume'}:
        assert key in quoted, f'docs/settings_assumed.md does not mention {module}: {name}.{key}'
        assert quoted[key] == pytest.approx(found[key], rel=1e-12), f'{module}: {name}.{key}'


def test_quoted_constants_of_modules_agree():
    checked = 0
    for row in ROWS:
        if row.pattern.endswith('.py') and row.key.isupper():
            if row.pattern.startswith('nodes/'):
                pytest.importorskip('rclpy', reason='constants of nodes need ROS 2')
            part = importlib.import_module('ros_pad.' + row.pattern[:-3].replace('/', '.'))
            assert row.number == pytest.approx(getattr(part, row.key), rel=1e-12), row
            checked += 1
    assert checked >= 3


def test_measured_effects_are_those_of_the_study(document):
    """Each measured row of the pages has the figures of docs/charts/assumptions.json."""
    measured = document['assumptions']
    for entry in measured:
        pattern, key = entry['where'].split(': ')
        own = [
            row
            for row in ROWS
            if row.halved is not None and row.key == key and fnmatch.fnmatch(pattern, row.pattern)
        ]
        assert len(own) == 1, f'{entry["where"]} has {len(own)} measured rows'
        for word, quoted in (('halved', own[0].halved), ('doubled', own[0].doubled)):
            part = entry[word]
            figures = [float(text) for text in quoted.split(' / ')]
            assert figures == [
                pytest.approx(part['adaptive_mm_change'], abs=0.051),
                pytest.approx(part['gain_mm_change'], abs=0.051),
            ], f'{entry["where"]} {word}'
    assert len(measured) == sum(row.halved is not None for row in ROWS)


def test_grounds_where_adapting_does_not_pay_are_those_of_the_study_of_policies():
    text = PAGE.read_text(encoding='utf-8')
    document = json.loads((ROOT / 'docs' / 'charts' / 'policies.json').read_text(encoding='utf-8'))
    grounds = document['against']['grounds']
    for name in ('dry all over', 'wet all over', 'nothing towed', 'patches of 0.3 m'):
        row = grounds[name]
        line = next(line for line in text.splitlines() if line.startswith(f'| {name} |'))
        *distances, ratio = line.strip('| ').split(' | ')[1:]
        walked = [row[policy]['mm_a_cycle'] for policy in ('flat', 'dome', 'adaptive', 'oracle')]
        assert [float(cell) for cell in distances] == pytest.approx(walked, abs=0.051)
        assert ratio == policies.interval(row['ratios']['adaptive'][policies.BETTER])


def test_the_study_starts_from_what_is_shipped(document):
    setup = assumptions.shipped()
    assert len(assumptions.ASSUMPTIONS) == len(document['assumptions'])
    for assumption, entry in zip(assumptions.ASSUMPTIONS, document['assumptions'], strict=True):
        assert assumption.where == entry['where']
        value = assumptions.baseline(setup, assumption)
        assert value == entry['value'], f'{assumption.where}: run python -m studies assumptions'


@pytest.mark.slow
def test_the_study_walks_as_a_trial_does():
    """With the shipped settings the study gives exactly the walk of a trial."""
    setup = assumptions.shipped()
    scene = dataclasses.replace(setup.world, cycles=3)
    distance, verdict = assumptions.walk(
        dataclasses.replace(setup, world=scene, configured=scene), 'adaptive', 1
    )
    assert verdict is None
    shipped = dataclasses.replace(assumptions.Scene.load(assumptions.SCENE), cycles=3)
    assert distance == run(shipped, 'adaptive', seed=1).metrics.distance_m / 3


def test_the_study_changes_what_it_names():
    """Every altered setup differs from the shipped one by the stated rule, and only there."""
    setup = assumptions.shipped()
    for assumption in assumptions.ASSUMPTIONS:
        value = assumptions.baseline(setup, assumption)
        for factor in (0.5, 2.0):
            altered = assumptions.wrong_by(setup, assumption, factor)
            assert altered != setup
            got = assumptions.baseline(altered, assumption)
            if assumption.rule in ('factor', 'mass'):
                assert got == pytest.approx(factor * value)
            elif assumption.rule == 'odds':
                assert got / (1.0 - got) == pytest.approx(factor * value / (1.0 - value))
            elif assumption.rule == 'excess':
                assert got - 1.0 == pytest.approx(factor * (value - 1.0))
            else:
                assert got == int(factor * value)
            if assumption.rule == 'mass':
                ratio = altered.world.body.inertia / setup.world.body.inertia
                assert ratio == pytest.approx(factor)
            elif not assumption.path.startswith('both'):
                back = assumptions.changed(altered, assumption.path, value)
                assert back == setup
            if assumption.path.startswith('both'):
                configured = assumption.path.replace('both.', 'configured.')
                assert assumptions.value_at(altered, configured) == got

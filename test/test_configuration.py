# SPDX-License-Identifier: Apache-2.0
import math
import re

import numpy as np
import pytest

from ros_pad import configuration
from ros_pad.configuration import Setting, Table, number, quantity
from ros_pad.errors import ConfigError, InvalidInput


def table(text, tmp_path):
    path = tmp_path / 'some.yaml'
    path.write_text(text, encoding='utf-8')
    return Table.load(path)


# --- single values ----------------------------------------------------------------------------


@pytest.mark.parametrize(
    ('value', 'bad'),
    [
        ([1.0, 0.5, math.nan], '0.5'),
        (np.array([2, 7]), '7'),
        (math.nan, 'nan'),
        (np.float64(6.0), '6.0'),
        (True, 'True'),
        ('2', "'2'"),
        ([1.0, [2.0]], '[1.0, [2.0]]'),
        (None, 'None'),
    ],
)
def test_the_first_bad_value_is_named_with_unit_and_range(value, bad):
    message = f'force = {bad} is not allowed: a number from 1 to 5 N is needed'
    with pytest.raises(InvalidInput, match=re.escape(message)):
        quantity('force', value, 'N', 1.0, 5.0)


def test_one_number_and_no_array():
    assert number('force', np.float32(2.0), 'N') == 2.0
    assert type(number('force', 2, 'N')) is float
    for bad in ([2.0], (2.0,), np.array([2.0]), '2'):
        with pytest.raises(InvalidInput, match=r'force = .* N is needed'):
            number('force', bad, 'N')


# --- settings ---------------------------------------------------------------------------------

LEGS = Setting('legs', [1, 2, 3], 'Legs.', '', 1, 6)
MASS = Setting('mass', float, 'Mass of the body.', 'kg', 0.1, 10.0)
COUNT = Setting('count', 3, 'How many.', '', 0, 9)


def test_settings_accept_values_of_their_type():
    assert MASS.value_type is float and COUNT.value_type is int
    assert type(MASS.accept(2)) is float
    assert COUNT.accept(9) == 9
    assert LEGS.accept([6, 2]) == [6, 2]
    assert Setting('live', True, 'Whether.').accept(False) is False
    assert Setting('kind', 'dry', 'Which.', choices=('dry', 'wet')).accept('wet') == 'wet'
    assert Setting('name', '', 'Name.').accept('any') == 'any'


@pytest.mark.parametrize(
    ('setting', 'bad'),
    [
        (MASS, '2'), (MASS, 11), (MASS, [1.0]), (COUNT, 1.0), (COUNT, 10), (LEGS, []),
        (LEGS, [7]), (LEGS, [2, 2]), (LEGS, [1.0]), (LEGS, [True]), (LEGS, 1), (LEGS, [[1]]),
        (Setting('live', True, 'Whether.'), 1), (Setting('name', '', 'Name.'), 3),
    ],
)  # fmt: skip
def test_settings_name_what_is_allowed(setting, bad):
    message = f'{setting.name} = {bad!r} is not allowed: {setting.allowed} is needed'
    with pytest.raises(InvalidInput, match=re.escape(message)):
        setting.accept(bad)


# --- numbers ----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    'written',
    [
        '.nan', 'nan', "'nan'", '.inf', '-.inf', 'inf', 'Infinity', 'true', 'yes', 'null', '~', '',
        '[1]', '{a: 1}', 'fast', '12 Pa', '1' + 400 * '0', '1e999', '2026-01-01',
    ],
)  # fmt: skip
def test_what_is_no_finite_number(tmp_path, written):
    with pytest.raises(
        ConfigError, match=r'some\.yaml: key = .* is not allowed: a finite number'
    ) as e:
        table(f'key: {written}', tmp_path).number('key', 'Pa')
    assert 'Pa is needed' in str(e.value)


# --- other kinds ------------------------------------------------------------------------------


def test_nested_tables_say_where(tmp_path):
    values = table('outer:\n  inner:\n    key: -1', tmp_path)
    with (
        pytest.raises(ConfigError, match=r'some\.yaml: outer: inner: key = -1'),
        values.table('outer') as outer,
        outer.table('inner') as inner,
    ):
        inner.number('key', 'm', 0.0)


def test_unknown_key_and_the_nearest(tmp_path):
    values = table('frictoin: 1', tmp_path)
    values.number('friction', '', default=0.0)
    values.number('pads', '', default=0.0)
    with pytest.raises(ConfigError) as caught:
        values.finish()
    message = str(caught.value)
    assert "unknown key 'frictoin'. Did you mean 'friction'? Allowed: friction, pads" in message


# --- files ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    'text, message',
    [
        ('a: [1, 2', 'not valid YAML'),
        ('a: 1\n b: 2', 'line 2, column 3: not valid YAML'),
        ('a: 1\na: 2', r"line 2, column 1: not valid YAML: key 'a' occurs twice"),
        ('a:\n  b: 1\n  b: 2', r"line 3, column 3.*'b' occurs twice"),
        ('a: !!python/object/apply:os.system [ls]', 'not valid YAML'),
        ('{[1]: 2}', 'not valid YAML'),
        ('a: \x01', 'not valid YAML'),
        ('a: 2026-99-99', 'not valid YAML: month must be in 1..12'),
        ('a: 0x_', 'not valid YAML: invalid literal'),
        # PyYAML raises other kinds of errors for these.
        ("a: !!int ''", 'not valid YAML: string index out of range'),
        ('a: !!bool maybe', "not valid YAML: 'maybe'"),
        ('a: !!timestamp soon', 'not valid YAML: '),
        # Newer versions of libyaml have a limit themselves.
        (
            'a: ' + '[' * 5000,
            'line 1, column .*(nested more than 100 deep|maximum nesting)',
        ),
        ('- ' * 5000, 'line 1, column 201: not valid YAML: nested more than 100 deep'),
        ('a:\n\tb: 1', r'line 2, column 1: .* \(a tab: YAML is indented with spaces\)'),
        ('', 'expected a table of keys, found nothing'),
        ('- 1\n- 2', 'expected a table of keys'),
        ('word', 'expected a table of keys'),
    ],
)
def test_bad_yaml(tmp_path, text, message):
    with pytest.raises(ConfigError, match=message) as caught:
        table(text, tmp_path)
    assert 'some.yaml' in str(caught.value)


@pytest.mark.parametrize(
    ('key', 'hint'), [('radus', "; is 'radus' a misspelling of it?"), ('ceiling', '')]
)
def test_a_missing_key_may_be_misspelt(tmp_path, key, hint):
    with pytest.raises(ConfigError) as caught:
        table(f'{key}: 1', tmp_path).number('radius', 'm')
    assert str(caught.value).endswith(f"key 'radius' is missing{hint}")


def test_what_aliases_make_vast_is_shown_in_short(tmp_path):
    lines = ['a0: &a0 [x, x, x, x, x, x, x, x, x]']
    lines += [f'a{n}: &a{n} [{", ".join(9 * [f"*a{n - 1}"])}]' for n in range(1, 9)]
    values = table('\n'.join(lines), tmp_path)
    with pytest.raises(ConfigError, match=r'a8 = .* is not allowed') as caught:
        values.number('a8', 'Pa')
    assert len(str(caught.value)) < 5000


def test_unreadable_files(tmp_path):
    path = tmp_path / 'latin.yaml'
    path.write_bytes(b'name: caf\xe9')
    for where in (path, tmp_path, tmp_path / 'none.yaml'):
        with pytest.raises(ConfigError, match=re.escape(f'{where}: cannot be read')):
            Table.load(where)


@pytest.mark.parametrize('kind', ['feet', 'scenes'])
def test_shipped_names(kind):
    names = configuration.names(kind)
    assert names == sorted(names) and names
    for name in names:
        path = configuration.locate(kind, name)
        assert path.is_file() and path.stem == name
        assert configuration.locate(kind, str(path)) == path
        assert configuration.locate(kind, path) == path


def test_unknown_names():
    with pytest.raises(ConfigError) as caught:
        configuration.locate('scenes', 'hexapod_patch')
    message = str(caught.value)
    assert "no scene named 'hexapod_patch'. Did you mean 'hexapod_patches'?" in message
    assert ', '.join(configuration.names('scenes')) in message
    with pytest.raises(ConfigError, match=r"no foot named 'qqq'\. There are: "):
        configuration.locate('feet', 'qqq')
    with pytest.raises(ConfigError, match=r'nowhere/my\.yaml: no such file'):
        configuration.locate('scenes', 'nowhere/my.yaml')


def test_shared_folder_of_an_installed_package(tmp_path, monkeypatch):
    share = tmp_path / 'share' / 'ros_pad' / 'config'
    (share / 'scenes').mkdir(parents=True)
    package = tmp_path / 'too' / 'deep' / 'for' / 'it' / 'ros_pad'
    package.mkdir(parents=True)
    monkeypatch.setattr(configuration, '__file__', str(package / 'configuration.py'))
    monkeypatch.setenv('AMENT_PREFIX_PATH', f'/nowhere:{tmp_path}')
    assert configuration.shared_folder() == share
    monkeypatch.setenv('AMENT_PREFIX_PATH', '')
    monkeypatch.setattr(configuration.sys, 'prefix', '/nowhere')
    with pytest.raises(ConfigError, match='no config folder of ros_pad found; looked in'):
        configuration.shared_folder()


@pytest.mark.parametrize(
    'place',
    ['.', 'lib/python3.12/site-packages', 'lib/python3/dist-packages'],
)
def test_the_shared_folder_is_that_of_the_package(tmp_path, monkeypatch, place):
    """It is not that of another version in the virtual environment or in a sourced workspace."""
    folders = {}
    for name in ('own', 'other'):
        folders[name] = tmp_path / name / 'share' / 'ros_pad' / 'config'
        (folders[name] / 'scenes').mkdir(parents=True)
    module = tmp_path / 'own' / place / 'ros_pad' / 'configuration.py'
    module.parent.mkdir(parents=True)
    monkeypatch.setattr(configuration, '__file__', str(module))
    monkeypatch.setenv('AMENT_PREFIX_PATH', str(tmp_path / 'other'))
    monkeypatch.setattr(configuration.sys, 'prefix', str(tmp_path / 'other'))
    assert configuration.shared_folder() == folders['own']

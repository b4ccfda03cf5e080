# SPDX-License-Identifier: Apache-2.0
import base64
import dataclasses
import html.parser
import re
import resource
import warnings
import xml.etree.ElementTree as ElementTree

import matplotlib.image
import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg

from ros_pad.errors import InvalidInput, PadError
from ros_pad.estimation import DOUBTS
from ros_pad.reports import files, report, style
from ros_pad.reports.view import view_of, window_of
from ros_pad.simulation import Scene
from ros_pad.simulation.terrain import Floor
from ros_pad.trials import conditions, run
from ros_pad.trials.trial import SLOW, Metrics, Trial

# HTML elements without a closing tag.
VOID = {'meta', 'img', 'br', 'hr', 'link', 'input'}
CONTROL = ('slow_time', 'slow')
FAST = ('time', 'body', 'force', 'position')


class Page(html.parser.HTMLParser):
    """Tags, pictures and text of a page; the parser fails if tags do not match."""

    def __init__(self, text):
        super().__init__()
        self.open, self.tags, self.images, self.words = [], [], [], []
        self.feed(text)
        assert self.open == []

    def handle_starttag(self, tag, attributes):
        self.tags.append(tag)
        if tag == 'img':
            self.images.append(dict(attributes))
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag, attributes):
        self.tags.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        if self.open and self.open[-1] not in ('style', 'script'):
            self.words.append(data)

    @property
    def text(self):
        return re.sub(r'\s+', ' ', ' '.join(self.words))

    def alt(self, start):
        return next(image['alt'] for image in self.images if image['alt'].startswith(start))


def metrics(per_cycle, **changes):
    return dataclasses.replace(
        Metrics(
            distance_m=per_cycle * 20,
            duration_s=21.0,
            cycles=20.0,
            distance_per_cycle_m=per_cycle,
            slip_path_m=[0.25, 0.75],
            lateral_drift_m=-0.0125,
            yaw_drift_rad=0.1,
            dissipation_j=3.5,
            switches=[3, 4],
            overload_s=[0.0, 0.5],
            wet_accuracy=0.875,
            verdict=None,
        ),
        **changes,
    )


def made_up(per_cycle=0.12, policy='adaptive'):
    """Return a made-up trial of 20 s with two legs that stand in turn, a second each.

    Leg 2 is a dome after 10 s. The body moves 0.1 m/s; the floor is wet from x = 1 m on.
    """
    time = np.arange(1, 2001) * 0.01
    slow = time[1::2]
    ahead = 0.1 * time
    standing = np.stack([(time % 2.0) < 1.0, (time % 2.0) >= 1.0], axis=1)
    force = np.zeros((2000, 2, 3))
    force[:, :, 2] = np.where(standing, 10.0, 0.0)
    place = np.floor(time)[:, None] * 0.1
    position = np.stack([
        np.stack([place[:, 0], np.full(2000, side), np.zeros(2000)], axis=1)
        for side in (0.1, -0.1)
    ], axis=1)  # fmt: skip
    known = np.zeros((1000, 2), SLOW)
    known['dome'][:, 1] = slow > 10.0
    known['pressure'] = known['setpoint'] = np.where(known['dome'], 60e3, 0.0)
    known['wetness'] = np.where(slow[:, None] > 10.5, 0.9, 0.1)
    known['doubt'] = -1
    return Trial(
        scene='made_up',
        policy=policy,
        fidelity='L1',
        seed=7,
        legs=(1, 2),
        time=time,
        body=np.stack([ahead, 0.0 * time, 0.0 * time], axis=1),
        force=force,
        position=position,
        slow_time=slow,
        slow=known,
        floor=Floor(np.array([[False, True, True, True]]), 1.0, (0.0, -0.5), 3e-4),
        metrics=metrics(per_cycle),
        settings={
            'expected_load': 10.0,
            'stride_m': 0.16,
            'omitted': [
                {'term': 'wind & weather', 'bound': 0.034, 'reason': 'indoors'},
                {'term': 'moods', 'bound': None, 'reason': 'nobody asked'},
                {
                    'term': 'tides',
                    'bound': 0.2,
                    'reason': 'the moon',
                    'kind': 'promise',
                    'effect': 0.3,
                    'exceeds': True,
                },
            ],
        },
    )


@pytest.fixture(scope='module')
def walk():
    """Return a short adaptive walk that crosses wet and dry ground."""
    scene = dataclasses.replace(Scene.load('hexapod_patches'), cycles=3)
    return run(scene, 'adaptive', seed=0)


def written(trial, folder, **given):
    report.write(trial, folder / 'r.html', force=True, **given)
    return Page((folder / 'r.html').read_text(encoding='utf-8'))


def test_a_report_needs_no_other_file_and_no_network(walk, tmp_path):
    path = tmp_path / 'new' / 'report.html'
    report.write(walk, path, others=[dataclasses.replace(walk, policy='flat')])
    text = path.read_text(encoding='utf-8')
    seen = Page(text)
    assert not {'link', 'iframe', 'object', 'script'} & set(seen.tags)
    assert not re.search(r'https?://|@import|url\(|fetch\(|XMLHttp', text)
    # The policy of the page forbids a browser to load anything from elsewhere.
    assert "content=\"default-src 'none'; img-src data:; style-src 'unsafe-inline'" in text
    assert len(seen.images) == 3
    for image in seen.images:
        kind, data = image['src'].split(',', 1)
        assert kind == 'data:image/svg+xml;base64' and len(image['alt']) > 20
        drawing = ElementTree.fromstring(base64.b64decode(data))
        references = [
            value for part in drawing.iter() for name, value in part.items() if 'href' in name
        ]
        assert all(value.startswith(('#', 'data:image/png')) for value in references)
    for words in ('hexapod_patches', 'seed 0', 'simulation L2', 'has and leaves out'):
        assert words in seen.text


def test_a_full_disk_leaves_nothing_half_written(tmp_path):
    path = tmp_path / 'page.html'
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, hard))
    try:
        with pytest.raises(PadError, match=r'page\.html: cannot be written'):
            files.save(path, bytes(2000))
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert not list(tmp_path.iterdir())


def test_nothing_is_replaced_unless_forced(tmp_path):
    path = tmp_path / 'report.html'
    path.write_text('mine')
    with pytest.raises(PadError, match=r'report\.html: exists'):
        report.write(made_up(), path)
    assert path.read_text() == 'mine'
    (tmp_path / 'page').mkdir()
    with pytest.raises(PadError, match='is no regular file'):
        report.write(made_up(), tmp_path / 'page', force=True)
    with pytest.raises(PadError, match='cannot be written'):
        report.write(made_up(), path / 'report.html')
    with pytest.raises(InvalidInput, match=r'trial\.png: exists'):
        (tmp_path / 'trial.png').write_text('mine')
        files.write_figures(report.drawn(made_up()), tmp_path)
    assert {each.name for each in tmp_path.iterdir()} == {'page', 'report.html', 'trial.png'}


def test_metrics_and_comparison_in_words(tmp_path):
    trial = made_up(0.12)
    trial.settings['comparison'] = [
        {'policy': 'flat', **metrics(0.1).as_dict()},
        {'policy': 'oracle', **metrics(0.15).as_dict()},
    ]
    seen = written(trial, tmp_path, others=[made_up(0.12, policy='dome')])
    text = seen.text
    assert re.search(r'2\.40 m in 20 gait cycles, 120 mm', text)
    gains = re.findall(r'(\S+) % against .*?\((\d+) mm\)', text)
    assert gains == [('+20', '100'), ('+0', '120'), ('-20', '150')]
    assert re.search(r'advance per cycle *mm *100\.0 *120\.0 *120\.0 *150\.0', text)
    assert re.search(r'slip path *m *(0\.50 *){4}', text)
    assert re.search(r'sideways drift *mm *(−12\.5 *){4}', text)
    assert re.search(r'heading drift *° *(5\.73 *){4}', text)  # 0.1 rad
    assert re.search(r'morphology changes *(7 *){4}', text)
    assert re.search(r'wetness accuracy *% *(87\.5 *){4}', text)
    assert re.search(r'slip path *mm *250 *750', text)
    assert re.findall(r'(\w+) (\d+) mm', seen.alt('Bars: ')) == [
        ('flat', '100'), ('dome', '120'), ('adaptive', '120'), ('oracle', '150'),
    ]  # fmt: skip


def test_what_went_wrong_is_listed(tmp_path):
    assert 'Fault' not in written(made_up(), tmp_path).text
    trial = made_up()
    faults = [
        {'leg': leg, 'start': k, 'end': k + 0.1, 'kind': 'out of range', 'reason': f'z = {k} N'}
        for k in range(30)
        for leg in (1, 2)
    ]
    faults.append({'leg': 2, 'start': 12.0, 'end': None, 'kind': 'leaks', 'reason': 'leaks'})
    trial.metrics = metrics(0.12, verdict='it fell & lay', lateral_drift_m=-1e-6, faults=faults)
    trial.settings |= {
        'interrupted': True,
        'repaired': True,
        'lost': {'/leg_2/wrench': 7, '/leg_1/wrench': 12},
        'faults': ['{"kind": "leak", "legs": [2]}'],
        'problem': 'bag: was not closed',
    }
    text = written(trial, tmp_path).text
    for words in (
        *('it fell & lay', 'stopped early', 'The bag was repaired', 'bag: was not closed'),
        *('12 on /leg_1/wrench, 7 on /leg_2/wrench', '{"kind": "leak", "legs": [2]}'),
        *(f'Leg {leg}, 30 times from 0.0 s to 29.1 s: out of range' for leg in (1, 2)),
        'Leg 2, from 12.0 s to the end: leaks',
    ):
        assert words in text
    assert text.count('out of range') == 2
    assert re.search(r'sideways drift *mm *0\.0', text)


def test_window_and_omissions(tmp_path):
    seen = written(made_up(), tmp_path)
    # At 10 s both legs come onto wet ground, and leg 2 becomes a dome.
    assert 'From 6 s to 14 s' in seen.text
    assert re.search(r'wind & weather *no *≤ 3\.4 % *not known *indoors', seen.text)
    tides = r'tides *no *≤ 20\.0 % in 95 of 100 scenes *≈ 30\.0 %, exceeds the accuracy required'
    assert re.search(tides, seen.text)
    assert re.search(r'moods *no *(not known *){2}nobody asked', seen.text)


def test_each_leg_has_its_own_series():
    trial = made_up()
    trial.slow['slip_speed'] = np.stack([0.001 * trial.slow_time, 0.01 * trial.slow_time], axis=1)
    trial.slow['wetness'] = np.stack([0.1 + 0.0 * trial.slow_time] * 2, axis=1)
    trial.slow['wetness'][:, 1] = 0.7
    figures = report.drawn(trial)
    start, end = window_of(view_of(trial))
    near = (trial.slow_time >= start) & (trial.slow_time <= end)
    fast = (trial.time >= start) & (trial.time <= end)
    axes = np.array(figures['window'].figure.axes).reshape(2, 4)
    whole = figures['trial'].figure.axes
    for column, (force, pressure, wetness, slip) in enumerate(axes):
        assert force.get_ylabel() == f'leg {trial.legs[column]}'
        np.testing.assert_array_equal(force.lines[0].get_ydata(), trial.force[fast, column, 2])
        measured, wanted = (line.get_ydata() for line in pressure.lines)
        np.testing.assert_array_equal(measured, 1e-3 * trial.slow['pressure'][near, column])
        np.testing.assert_array_equal(wanted, 1e-3 * trial.slow['setpoint'][near, column])
        assert set(wetness.lines[0].get_ydata()) == {trial.slow['wetness'][0, column]}
        np.testing.assert_array_equal(slip.lines[0].get_ydata(),
                                      1e3 * trial.slow['slip_speed'][near, column])  # fmt: skip
        assert set(whole[column].lines[0].get_ydata()) == {trial.slow['wetness'][0, column]}


def without(names):
    trial = made_up()
    return dataclasses.replace(trial, **{name: getattr(trial, name)[:0] for name in names})


def all_nan(names):
    trial = made_up()
    nan = {name: np.full_like(getattr(trial, name), np.nan) for name in names}
    for name in ('pressure', 'setpoint', 'wetness', 'slip_speed'):
        trial.slow[name] = np.nan
    return dataclasses.replace(trial, settings={}, **nan)


POOR = {
    'robot': lambda: dataclasses.replace(
        made_up(), scene='', policy='', fidelity='', floor=None, metrics=None, settings={}
    ),
    'no estimates': lambda: without(CONTROL),
    'no wrenches': lambda: without(FAST),
    'nothing': lambda: dataclasses.replace(
        without(CONTROL + FAST), metrics=None, floor=None, settings={}
    ),
    'all unknown': lambda: all_nan(('body', 'force', 'position')),
    'one sample': lambda: dataclasses.replace(
        made_up(), **{name: getattr(made_up(), name)[:1] for name in FAST + CONTROL},
    ),
}  # fmt: skip


@pytest.mark.parametrize('kind', POOR)
def test_values_that_are_missing_are_left_out(kind, tmp_path):
    with warnings.catch_warnings():
        warnings.simplefilter('error')
        text = written(POOR[kind](), tmp_path).text
    assert 'Metrics' in text and 'nan' not in text.lower()
    if kind == 'robot':
        assert 'the body moved by 2.00 m in 20.0 s' in text
        assert 'no scene is on record' in text and 'command to repeat it' not in text


def test_names_cannot_break_the_page(tmp_path):
    trial = dataclasses.replace(made_up(), scene='<b>"x" & y</b>', policy='<i>')
    trial.settings['comparison'] = [{'policy': '<u>', **metrics(0.1).as_dict()}]
    seen = written(trial, tmp_path)
    assert '<b>"x" & y</b>' in seen.text
    assert not {'i', 'u'} & set(seen.tags)


def test_unobservable_ground_is_counted_by_stance():
    """Leg 1 has ten stances that end at odd seconds, leg 2 ten at even seconds, five domed."""
    trial = made_up()
    assert report.unobservable_shares(trial, 3.0) == ''
    trial.slow['doubt'] = np.where(trial.slow['dome'], DOUBTS.index('domed'), 0)
    trial.slow['doubt'][trial.slow_time < 2.0, :] = DOUBTS.index('not pulled')
    text = report.unobservable_shares(trial, 3.0)
    ends = [*range(1, 20, 2), *range(2, 21, 2)]
    not_pulled = sum(end <= 2 for end in ends)
    domed = sum(end > 10 and end % 2 == 0 for end in ends)
    assert f'At the end of {len(ends) - not_pulled - domed} of {len(ends)} stances' in text
    assert f'domed {100 * domed / len(ends):.0f} %' in text
    assert f'not pulled {100 * not_pulled / len(ends):.0f} %' in text


def test_conditions_say_how_to_repeat_a_walk(walk):
    rows = dict(conditions.rows(walk))
    assert 'pad.stiffness 40.0' in rows['foot'] and 'wet_fraction 0.45' in rows['floor']
    assert rows['command to repeat it'] == (
        'pad run hexapod_patches --policy adaptive --seed 0 --fidelity L2 --cycles 3'
        ' --foot large37 --sensing markers'
    )


def test_figures_for_a_paper(tmp_path):
    """Width of columns, fonts inside, nothing cut off, the same bytes each time."""
    trial = made_up()
    trial.settings['comparison'] = [{'policy': 'oracle', **metrics(0.1).as_dict()}]
    figures = report.drawn(trial)
    again = {'comparison': report.drawn(trial)['comparison']}
    files.write_figures(figures, tmp_path / 'one')
    files.write_figures(again, tmp_path / 'two')
    assert {path.name for path in (tmp_path / 'one').iterdir()} == {
        f'{stem}.{kind}' for stem in ('comparison', 'trial', 'window') for kind in ('pdf', 'png')
    }
    for path in (tmp_path / 'two').iterdir():
        assert (tmp_path / 'one' / path.name).read_bytes() == path.read_bytes(), path.name
    for name, each in figures.items():
        data = (tmp_path / 'one' / f'{name}.pdf').read_bytes()
        wide = float(re.search(rb'/MediaBox \[ 0 0 ([0-9.]+)', data)[1]) / 72.0 * 25.4
        assert wide == pytest.approx(85.0 if name == 'comparison' else 175.0, abs=0.01)
        # Fonts are TrueType, which editors can use, and there is no date.
        assert b'/FontFile2' in data and b'/Type3' not in data
        assert b'CreationDate' not in data and b'/Producer' not in data
        picture = matplotlib.image.imread(tmp_path / 'one' / f'{name}.png')
        assert picture.shape[1] == pytest.approx(wide / 25.4 * 300, abs=1.5)
        with matplotlib.rc_context(style.PAPER_STYLE):
            box = each.figure.get_tightbbox(FigureCanvasAgg(each.figure).get_renderer())
        width, height = each.figure.get_size_inches()
        assert box.x0 > -0.01 and box.y0 > -0.01, name
        assert box.x1 < width + 0.01 and box.y1 < height + 0.01, name

# SPDX-License-Identifier: Apache-2.0
import base64
import dataclasses
import html.parser
import json
import re
import resource
import subprocess
import sys
import warnings
import xml.etree.ElementTree as ElementTree

import matplotlib.image
import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg

from ros_pad.errors import InvalidInput, PadError
from ros_pad.estimation import DOUBTS
from ros_pad.reports import files, margins, reliability, report, style
from ros_pad.reports.view import view_of
from ros_pad.simulation import Scene
from ros_pad.simulation.terrain import Floor
from ros_pad.trials import conditions, run
from ros_pad.trials.label import described
from ros_pad.trials.trial import Metrics, Trial

# HTML elements without a closing tag.
VOID = {'meta', 'img', 'br', 'hr', 'link', 'input'}
SLOW = ('slow_time', 'pressure', 'setpoint', 'wet_probability', 'friction', 'margin',
        'slip_speed', 'slipping', 'dome')  # fmt: skip
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


def page(path):
    return Page(path.read_text(encoding='utf-8'))


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
    dome = np.stack([np.zeros(1000, dtype=bool), slow > 10.0], axis=1)
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
        pressure=np.where(dome, 60e3, 0.0),
        setpoint=np.where(dome, 60e3, 0.0),
        wet_probability=np.where(slow[:, None] > 10.5, 0.9, 0.1) * np.ones((1, 2)),
        friction=np.full((1000, 2), 0.5),
        margin=np.full((1000, 2), 0.2),
        slip_speed=np.zeros((1000, 2)),
        slipping=np.zeros((1000, 2), dtype=bool),
        dome=dome,
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
    scene = dataclasses.replace(Scene.load('hexapod_patches'), cycles=30)
    trial = run(scene, 'adaptive', seed=0)
    assert trial.dome.any() and not trial.dome.all()
    return trial


def test_a_report_needs_no_other_file_and_no_network(walk, tmp_path):
    path = tmp_path / 'new' / 'report.html'
    report.write(walk, path, others=[dataclasses.replace(walk, policy='flat')])
    text = path.read_text(encoding='utf-8')
    assert len(text) < 4_000_000
    seen = Page(text)
    assert not {'link', 'iframe', 'object'} & set(seen.tags)
    assert 'script' not in seen.tags
    assert not re.search(r'https?://|@import|url\(|fetch\(|XMLHttp', text)
    # The policy of the page forbids a browser to load anything from elsewhere.
    assert "content=\"default-src 'none'; img-src data:; style-src 'unsafe-inline'" in text
    assert len(seen.images) == 6
    for image in seen.images:
        kind, data = image['src'].split(',', 1)
        assert kind == 'data:image/svg+xml;base64'
        drawing = ElementTree.fromstring(base64.b64decode(data))
        assert drawing.tag == '{http://www.w3.org/2000/svg}svg'
        references = [
            value for part in drawing.iter() for name, value in part.items() if 'href' in name
        ]
        assert all(value.startswith(('#', 'data:image/png')) for value in references)
        assert len(image['alt']) > 20
    for words in ('hexapod_patches', 'seed 0', 'simulation L2', 'has and leaves out'):
        assert words in seen.text


def test_the_same_trial_gives_the_same_file(tmp_path):
    report.write(made_up(), tmp_path / 'one.html')
    report.write(made_up(), tmp_path / 'two.html')
    assert (tmp_path / 'one.html').read_bytes() == (tmp_path / 'two.html').read_bytes()


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


@pytest.mark.slow
def test_nothing_is_replaced_unless_forced(tmp_path):
    path = tmp_path / 'report.html'
    path.write_text('mine')
    with pytest.raises(PadError, match=r'report\.html: exists'):
        report.write(made_up(), path)
    assert path.read_text() == 'mine'
    report.write(made_up(), path, force=True)
    assert 'made_up' in path.read_text(encoding='utf-8')
    assert [each.name for each in tmp_path.iterdir()] == ['report.html']


def test_a_folder_that_is_a_file(tmp_path):
    (tmp_path / 'file').write_text('')
    with pytest.raises(PadError, match='cannot be written'):
        report.write(made_up(), tmp_path / 'file' / 'report.html')


def test_metrics_and_comparison_in_words(tmp_path):
    trial = made_up(0.12)
    trial.settings['comparison'] = [
        {'policy': 'flat', **metrics(0.1).as_dict()},
        {'policy': 'oracle', **metrics(0.15).as_dict()},
    ]
    report.write(trial, tmp_path / 'r.html', others=[made_up(0.12, policy='dome')])
    text = page(tmp_path / 'r.html').text
    assert re.search(r'2\.40 m in 20 gait cycles, 120 mm', text)
    assert re.search(
        r'20 % further .*flat \(100 mm\).*dome \(120 mm\).*20 % less .*\(150 mm\)', text
    )
    assert re.search(r'advance per cycle *mm *100\.0 *120\.0 *120\.0 *150\.0', text)
    assert re.search(r'slip path *m *(0\.50 *){4}', text)
    assert re.search(r'sideways drift *mm *(−12\.5 *){4}', text)
    assert re.search(r'heading drift *° *(5\.73 *){4}', text)  # 0.1 rad
    assert re.search(r'morphology changes *(7 *){4}', text)
    assert re.search(r'wetness accuracy *% *(87\.5 *){4}', text)
    assert re.search(r'slip path *mm *250 *750', text)
    bars = page(tmp_path / 'r.html').alt('Bars: ')
    assert re.findall(r'(\w+) (\d+) mm', bars) == [
        ('flat', '100'), ('dome', '120'), ('adaptive', '120'), ('oracle', '150'),
    ]  # fmt: skip


def test_a_walk_that_is_not_valid_is_marked(tmp_path):
    trial = made_up()
    trial.metrics = metrics(0.12, verdict='it fell & lay', lateral_drift_m=-1e-6)
    trial.settings['interrupted'] = True
    trial.settings['repaired'] = True
    trial.settings['lost'] = {'/leg_2/wrench': 7, '/leg_1/wrench': 12}
    report.write(trial, tmp_path / 'r.html')
    text = page(tmp_path / 'r.html').text
    assert 'it fell & lay' in text
    assert 'stopped early' in text
    assert 'The bag was repaired' in text
    assert '12 on /leg_1/wrench, 7 on /leg_2/wrench' in text
    assert re.search(r'sideways drift *mm *0\.0', text)


def test_faults_are_listed(tmp_path):
    trial = made_up()
    report.write(trial, tmp_path / 'sound.html')
    assert 'Fault' not in page(tmp_path / 'sound.html').text
    trial.settings['faults'] = ['{"kind": "leak", "start": 5.0, "legs": [2]}']
    report.write(trial, tmp_path / 'faulty.html')
    fault = '{"kind": "leak", "start": 5.0, "legs": [2]}'
    assert fault in page(tmp_path / 'faulty.html').text


def test_what_the_controller_found_is_listed(tmp_path):
    trial = made_up()
    found = [
        {'leg': 2, 'start': 3.48, 'end': None, 'kind': 'leaks', 'reason': 'leaks'},
        {'leg': 1, 'start': 4.0, 'end': 9.5, 'kind': 'x', 'reason': 'does not vent'},
    ]
    trial.metrics = dataclasses.replace(trial.metrics, faults=found)
    report.write(trial, tmp_path / 'r.html')
    text = page(tmp_path / 'r.html').text
    assert 'Leg 2, from 3.5 s to the end: leaks' in text
    assert 'Leg 1, from 4.0 s to 9.5 s: does not vent' in text


def test_what_comes_and_goes_has_one_line(tmp_path):
    trial = made_up()
    found = [
        {
            'leg': leg,
            'start': k,
            'end': k + 0.1,
            'kind': 'force out of range',
            'reason': f'force out of range: z = {k} N',
        }
        for k in range(30)
        for leg in (1, 2)
    ]
    found.append({'leg': 2, 'start': 12.0, 'end': None, 'kind': 'leaks', 'reason': 'leaks'})
    trial.metrics = dataclasses.replace(trial.metrics, faults=found)
    report.write(trial, tmp_path / 'r.html')
    text = page(tmp_path / 'r.html').text
    for leg in (1, 2):
        assert f'Leg {leg}, 30 times from 0.0 s to 29.1 s: force out of range' in text
    assert text.count('out of range') == 2
    assert 'Leg 2, from 12.0 s to the end: leaks' in text


def test_footprints_window_and_omissions(tmp_path):
    report.write(made_up(), tmp_path / 'r.html')
    seen = page(tmp_path / 'r.html')
    # Leg 1 stands from 0, 2, ... 18 s and 20 s, leg 2 from 1, 3, ... 19 s, domed from 11 s on.
    assert '21 footprints, 5 of them of domes' in seen.alt('Map')
    # At 10 s both legs come onto wet ground, and leg 2 becomes a dome.
    assert 'From 6 s to 14 s' in seen.text
    # Flat stances with an end: ten of leg 1, five of leg 2.
    assert '15 flat stances' in seen.alt('Reliability')
    assert re.search(r'wind & weather *no *≤ 3\.4 % *not known *indoors', seen.text)
    tides = r'tides *no *≤ 20\.0 % in 95 of 100 scenes *≈ 30\.0 %, exceeds the accuracy required'
    assert re.search(tides, seen.text)
    assert re.search(r'moods *no *(not known *){2}nobody asked', seen.text)


def test_reliability_counts_what_was_wet():
    estimated, wet = reliability.outcomes(view_of(made_up()))
    # On the floor of made_up, all stances before 10 s are dry with P(wet) = 0.1; later ones
    # are wet with P(wet) = 0.9.
    assert sorted(estimated.tolist()) == [0.1] * 10 + [0.9] * 5
    np.testing.assert_array_equal(wet, estimated > 0.5)


def without(names, trial=None):
    trial = trial or made_up()
    return dataclasses.replace(trial, **{name: getattr(trial, name)[:0] for name in names})


def all_nan(names):
    trial = made_up()
    nan = {name: np.full_like(getattr(trial, name), np.nan) for name in names}
    return dataclasses.replace(trial, **nan)


POOR = {
    'robot': lambda: dataclasses.replace(
        made_up(), scene='', policy='', fidelity='', floor=None, metrics=None, settings={}
    ),
    'no estimates': lambda: without(SLOW),
    'no wrenches': lambda: without(FAST),
    'nothing': lambda: dataclasses.replace(
        without(SLOW + FAST), metrics=None, floor=None, settings={}
    ),
    'all unknown': lambda: dataclasses.replace(
        all_nan(('body', 'force', 'position', 'pressure', 'setpoint', 'wet_probability',
                 'slip_speed')), settings={}),
    'no markers': lambda: all_nan(('position', 'body')),
    'pressures unknown': lambda: all_nan(('pressure',)),
    'one sample': lambda: dataclasses.replace(
        made_up(),
        **{name: getattr(made_up(), name)[:1] for name in FAST + SLOW},
    ),
    'no metrics of wetness': lambda: dataclasses.replace(
        made_up(), metrics=metrics(0.0, wet_accuracy=None, cycles=0.0)
    ),
}  # fmt: skip


@pytest.mark.parametrize('kind', POOR)
def test_values_that_are_missing_are_left_out(kind, tmp_path):
    with warnings.catch_warnings():
        warnings.simplefilter('error')
        report.write(POOR[kind](), tmp_path / 'r.html')
    text = page(tmp_path / 'r.html').text
    assert 'Metrics' in text and 'nan' not in text.lower()


def test_a_robot_without_metrics(tmp_path):
    trial = POOR['robot']()
    trial.settings = {'recorded': '2025-06-15 15:06:40 UTC', 'problem': 'bag: was not closed'}
    report.write(trial, tmp_path / 'r.html')
    seen = page(tmp_path / 'r.html')
    assert 'the body moved by 2.00 m in 20.0 s' in seen.text
    assert 'recorded 2025-06-15 15:06:40 UTC' in seen.text
    assert 'bag: was not closed' in seen.text
    # The load gate follows from the forces.
    assert '21 footprints, 5 of them of domes' in seen.alt('Map')


def test_names_cannot_break_the_page(tmp_path):
    trial = dataclasses.replace(made_up(), scene='<b>"x" & y</b>', policy='<i>')
    trial.settings['comparison'] = [{'policy': '<u>', **metrics(0.1).as_dict()}]
    report.write(trial, tmp_path / 'r.html')
    seen = page(tmp_path / 'r.html')
    assert '<b>"x" & y</b>' in seen.text
    assert not {'i', 'u'} & set(seen.tags)


def test_progress_runs_from_little_to_all(tmp_path):
    shares = []
    report.write(made_up(), tmp_path / 'r.html', progress=shares.append)
    assert shares == sorted(shares) and shares[-1] == 1.0 and len(shares) >= 4


@pytest.mark.slow
def test_no_state_of_pyplot(tmp_path):
    program = (
        'import sys, matplotlib\n'
        'from ros_pad.reports import report\n'
        'assert "matplotlib.pyplot" not in sys.modules\n'
    )
    subprocess.run([sys.executable, '-c', program], check=True, timeout=60)
    before = dict(matplotlib.rcParams)
    report.write(made_up(), tmp_path / 'r.html')
    assert dict(matplotlib.rcParams) == before


def test_settings_survive_json(tmp_path):
    # Metadata of a bag are read from JSON, and give the same report.
    trial = made_up()
    report.write(trial, tmp_path / 'one.html')
    trial.settings = json.loads(json.dumps(trial.settings))
    report.write(trial, tmp_path / 'two.html')
    assert (tmp_path / 'one.html').read_bytes() == (tmp_path / 'two.html').read_bytes()


def test_what_is_no_regular_file_is_never_replaced(tmp_path):
    trial = run(dataclasses.replace(Scene.load('leg_dry_flat'), cycles=1))
    (tmp_path / 'page').mkdir()
    with pytest.raises(PadError, match='is no regular file'):
        report.write(trial, tmp_path / 'page', force=True)


def test_unobservable_ground_is_counted_by_stance():
    """Leg 1 has ten stances that end at odd seconds, leg 2 ten at even seconds, five domed."""
    trial = made_up()
    trial.doubt = np.where(trial.dome, DOUBTS.index('domed'), 0)
    trial.doubt[trial.slow_time < 2.0, :] = DOUBTS.index('not pulled')
    text = report.unobservable_shares(trial, 3.0)
    ends = [*range(1, 20, 2), *range(2, 21, 2)]
    assert f'of {len(ends)} stances' in text
    not_pulled = sum(end <= 2 for end in ends)
    domed = sum(end > 10 and end % 2 == 0 for end in ends)
    assert f'At the end of {len(ends) - not_pulled - domed} of' in text
    assert f'domed {100 * domed / len(ends):.0f} %' in text
    assert f'not pulled {100 * not_pulled / len(ends):.0f} %' in text


def test_without_reasons_on_record_nothing_is_counted():
    assert report.unobservable_shares(made_up(), 3.0) == ''


# --- conditions ----------------------------------------------------------------------------------


def test_conditions_of_a_walk_are_on_record(walk):
    rows = dict(conditions.rows(walk))
    assert 'recorded' in rows['conditions']
    assert f'numpy {np.__version__}' in rows['versions'] and 'python 3.' in rows['versions']


def test_conditions_of_a_scene_have_values_and_units(walk):
    rows = dict(conditions.rows(walk))
    assert rows['scene'].startswith('hexapod_patches; ') and '30 gait cycles' in rows['scene']
    assert rows['robot'].startswith('ch3r') and 'mass 2.09 kg' in rows['robot']
    assert rows['foot'].startswith('large37') and 'pad stiffness 40 N/m' in rows['foot']
    assert 'wet fraction 0.45' in rows['floor'] and 'viscosity 0.001 Pa s' in rows['floor']
    assert 'weight 9 N' in rows['towed load']
    (noise,) = (value for name, value in rows.items() if name.startswith('sensors'))
    for value in ('250 Hz', '0.03 N', '0.00015 m', '0 N m'):
        assert value in noise
    assert 'hose diameter 0.004 m' in rows['regulator and hose']
    assert 'hose length 1 m' in rows['regulator and hose']
    assert rows['seed of floor and noise'] == '0' and rows['policy'] == 'adaptive'
    assert rows['command to repeat it'] == (
        'pad run hexapod_patches --policy adaptive --seed 0 --fidelity L2 --cycles 30'
        ' --foot large37'
    )


def test_conditions_are_those_recorded(walk):
    scene = dataclasses.replace(Scene.load('hexapod_patches'), dome_pressure=70e3)
    said = described(scene)
    said['tow']['weight'] = 7.5
    settings = walk.settings | {
        'conditions': json.loads(json.dumps(said)),
        'versions': {'git': 'v0.1-3-gabcdef', 'numpy': '2.0.1'},
    }
    rows = dict(conditions.rows(dataclasses.replace(walk, settings=settings)))
    assert 'recorded' in rows['conditions']
    assert 'weight 7.5 N' in rows['towed load']
    assert rows['pressure of a dome'].startswith('70000 Pa gauge')
    assert rows['versions'] == 'git v0.1-3-gabcdef, numpy 2.0.1'


def test_conditions_stand_in_the_report_of_whatever_there_is(tmp_path):
    report.write(POOR['robot'](), tmp_path / 'r.html')
    text = page(tmp_path / 'r.html').text
    assert 'no scene is on record' in text and 'command to repeat it' not in text
    report.write(made_up(), tmp_path / 's.html')
    assert 'no scene is on record' in page(tmp_path / 's.html').text


# --- margins -------------------------------------------------------------------------------------


def test_use_of_the_force_limit():
    """By the line through the thesis' limits 37 pads carry 37 x 0.2833 N at 75 kPa."""
    trial = made_up()
    trial.settings['foot'] = 'large37'
    trial.pressure = np.where(trial.dome, 75e3, 0.0)
    used = margins.limit_use(view_of(trial))
    standing = trial.slow_time % 2.0 >= 1.0
    domed = trial.slow_time > 10.0
    sure = np.abs(trial.slow_time % 1.0 - 0.5) < 0.4  # away from touch-downs and lift-offs
    assert np.isnan(used[:, 0]).all()
    assert np.isnan(used[sure & ~(standing & domed), 1]).all()
    assert used[sure & standing & domed, 1] == pytest.approx(10.0 / (37 * 0.2833), rel=1e-3)


def test_margins_are_those_of_standing_feet():
    trial = made_up()
    trial.margin = np.full_like(trial.margin, -0.1)
    found = margins.standing_margins(view_of(trial))
    sure = np.abs(trial.slow_time % 1.0 - 0.5) < 0.4
    assert np.isnan(found[sure & (trial.slow_time % 2.0 >= 1.0), 0]).all()
    assert (found[sure & (trial.slow_time % 2.0 < 1.0), 0] == -0.1).all()


# --- figures for a paper -------------------------------------------------------------------------


@pytest.fixture(scope='module')
def printed(tmp_path_factory):
    """Write the figures of a trial; draw and write two of them once more."""
    trial = made_up()
    trial.settings['foot'] = 'large37'
    trial.settings['comparison'] = [{'policy': 'flat', **metrics(0.1).as_dict()}]
    folders = [tmp_path_factory.mktemp('one'), tmp_path_factory.mktemp('two')]
    files.write_figures(report.drawn(trial), folders[0])
    again = report.drawn(trial)
    files.write_figures({name: again[name] for name in ('path', 'reliability')}, folders[1])
    return folders


@pytest.mark.slow
def test_figures_of_a_trial_for_a_paper(printed):
    one, two = printed
    names = {path.name for path in one.iterdir()}
    stems = ('comparison', 'path', 'trial', 'window', 'margins', 'reliability')
    assert names == {f'{stem}.{kind}' for stem in stems for kind in ('pdf', 'png')}
    twice = {path.name for path in two.iterdir()}
    assert len(twice) == 4
    for name in twice:
        assert (one / name).read_bytes() == (two / name).read_bytes(), name


def test_figures_have_the_width_of_columns_and_fonts_inside(printed):
    for path in printed[0].glob('*.pdf'):
        data = path.read_bytes()
        wide = float(re.search(rb'/MediaBox \[ 0 0 ([0-9.]+)', data)[1]) / 72.0 * 25.4
        column = path.stem in ('comparison', 'reliability')
        assert wide == pytest.approx(85.0 if column else 175.0, abs=0.01)
        # Fonts are TrueType, which editors can use, and there is no date.
        assert b'/FontFile2' in data and b'/Type3' not in data
        assert b'CreationDate' not in data and b'/Producer' not in data
        picture = matplotlib.image.imread(path.with_suffix('.png'))
        assert picture.shape[1] == pytest.approx(wide / 25.4 * 300, abs=1.5)


def test_figures_are_not_cut_off():
    trial = made_up()
    trial.settings['foot'] = 'large37'
    trial.settings['comparison'] = [{'policy': 'oracle', **metrics(0.1).as_dict()}]
    for name, each in report.drawn(trial).items():
        with matplotlib.rc_context(style.PAPER_STYLE):
            canvas = FigureCanvasAgg(each.figure)
            canvas.draw()
            box = each.figure.get_tightbbox(canvas.get_renderer())
        width, height = each.figure.get_size_inches()
        assert box.x0 > -0.01 and box.y0 > -0.01, name
        assert box.x1 < width + 0.01 and box.y1 < height + 0.01, name


def test_figures_replace_nothing_unless_forced(printed, tmp_path):
    mine = tmp_path / 'reliability.png'
    mine.write_text('mine')
    drawn = report.drawn(made_up())
    drawn = {name: drawn[name] for name in ('margins', 'reliability')}
    with pytest.raises(InvalidInput, match=r'reliability\.png: exists'):
        files.write_figures(drawn, tmp_path)
    assert list(tmp_path.iterdir()) == [mine]
    files.write_figures(drawn, tmp_path, force=True)
    assert mine.read_bytes().startswith(b'\x89PNG')

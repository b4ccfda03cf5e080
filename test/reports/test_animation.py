# SPDX-License-Identifier: Apache-2.0
"""The data for the player of a report, and the page in a browser."""

import base64
import dataclasses
import html.parser
import json
import math
import os
import shutil
import subprocess

import numpy as np
import pytest

from ros_pad.reports import animation, report
from ros_pad.reports.view import view_of
from ros_pad.simulation.terrain import Floor
from ros_pad.trials.trial import Trial

CHROMIUM = next(filter(None, map(shutil.which, ('chromium', 'chromium-browser', 'chrome'))), None)


def walk(seconds=20.0, rate=250.0):
    """Return a made-up trial: a body on two feet moves at 0.1 m/s and turns at 0.1 rad/s.

    Leg 1 stands in even seconds and leg 2 in odd ones, each 0.2 m ahead of the body's position at
    the start of the second. Leg 2 is a dome from 10 s on. Leg 1 slips from 4.0 to 4.5 s. The floor
    is wet from x = 1 m on.
    """
    time = np.arange(1, round(seconds * rate) + 1) / rate
    slow = time[4::5]
    standing = np.stack([time % 2.0 < 1.0, time % 2.0 >= 1.0], axis=1)
    force = np.zeros((len(time), 2, 3))
    force[:, :, 2] = np.where(standing, 10.0, 0.0)
    ahead = 0.1 * np.floor(time) + 0.2
    position = np.stack(
        [np.stack([ahead, np.full(len(time), side), 0.0 * time], axis=1) for side in (0.1, -0.1)],
        axis=1,
    )
    pressure = np.stack([0.0 * slow, np.where(slow > 10.0, 62.3e3, 0.0)], axis=1)
    count = (len(slow), 2)
    return Trial(
        scene='', policy='', fidelity='', seed=0, legs=(1, 2), time=time,
        body=np.stack([0.1 * time, 0.0 * time, 0.1 * time], axis=1),
        force=force, position=position, slow_time=slow,
        pressure=pressure, setpoint=1.02 * pressure,
        wet_probability=np.stack([0.0 * slow + 0.07, 0.0 * slow + 0.93], axis=1),
        friction=np.full(count, 0.5), margin=np.full(count, 0.2), slip_speed=np.zeros(count),
        slipping=np.stack([(slow >= 4.0) & (slow < 4.5), slow < 0.0], axis=1),
        dome=pressure > 0.0,
        floor=Floor(np.array([[False, True, True, True]]), 1.0, (0.0, -0.5), 3e-4),
        settings={'foot': 'large37', 'expected_load': 10.0},
    )  # fmt: skip


def whole(differences):
    """Return a series from its differences, as the player does."""
    last, found = 0, []
    for each in differences:
        last += each or 0
        found.append(None if each is None else last)
    return found


def at(content, seconds):
    return round((seconds - content['start']) / content['step'])


def test_frames_show_the_walk():
    content = animation.data(view_of(walk()))
    assert content['step'] == pytest.approx(0.04)
    assert content['frames'] == 500
    frame = at(content, 12.52)
    assert whole(content['body']['x'])[frame] == pytest.approx(1252, abs=5)
    assert whole(content['body']['heading'])[frame] == pytest.approx(1252, abs=5)
    one, two = content['feet']
    assert (one['leg'], two['leg']) == (1, 2)
    assert whole(one['x'])[frame] == 1400 and whole(two['y'])[frame] == -100
    assert whole(two['pressure'])[frame] == 623 and whole(two['setpoint'])[frame] == 635
    assert whole(one['wet'])[frame] == 7 and whole(two['wet'])[frame] == 93
    for foot in content['feet']:
        assert all(len(foot[name]) == 500 for name in ('x', 'y', 'state', 'pressure', 'wet'))


@pytest.mark.parametrize(
    ('seconds', 'one', 'two'),
    [(0.5, 'f', 'a'), (3.5, 'a', 'f'), (4.3, 'F', 'a'), (4.7, 'f', 'a'), (13.5, 'a', 'd')],
)
def test_states_of_feet(seconds, one, two):
    content = animation.data(view_of(walk()))
    frame = at(content, seconds)
    assert [foot['state'][frame] for foot in content['feet']] == [one, two]


def test_a_foot_off_the_ground_does_not_slip():
    trial = walk()
    trial.slipping[:] = True
    states = {foot['state'][75] for foot in animation.data(view_of(trial))['feet']}
    assert states == {'a', 'F'}


def test_wet_ground_is_where_the_floor_has_it():
    trial = walk()
    content = animation.data(view_of(trial))['floor']
    bits = np.unpackbits(np.frombuffer(base64.b64decode(content['bits']), dtype=np.uint8))
    wet = bits[: content['rows'] * content['columns']].reshape(content['rows'], -1)
    for x, y in [(0.5, 0.0), (0.99, 0.3), (1.01, -0.3), (2.6, 0.1), (-0.5, 0.0)]:
        row = int((y - content['bottom']) // content['cell'])
        column = int((x - content['left']) // content['cell'])
        assert wet[row, column] == trial.floor.wet(x, y), (x, y)
    # The map covers all positions of feet and body, and what is seen around them.
    assert content['left'] < -0.5
    assert content['left'] + content['columns'] * content['cell'] > 2.5


def test_footprints_and_body():
    content = animation.data(view_of(walk()))
    assert len(content['steps']) == 21
    # Leg 2 stands from 3 to 4 s for the second time; the body was at 0.3 m.
    assert content['steps'][12] == [2, 3.0, 4.0, 500, -100, 0]
    domes = [step for step in content['steps'] if step[5]]
    assert [step[1] for step in domes] == pytest.approx([11.0, 13.0, 15.0, 17.0, 19.0], abs=0.01)
    assert content['sole'] == pytest.approx(0.017) and content['ceiling'] == pytest.approx(90.0)
    assert len(content['outline']) == 4  # for two feet the outline is a box


def test_a_long_trial_has_fewer_frames():
    trial = walk(seconds=1000.0, rate=10.0)
    content = animation.data(view_of(trial))
    assert content['frames'] <= animation.MOST_FRAMES + 1
    assert content['frames'] * content['step'] == pytest.approx(1000.0, rel=1e-3)


def test_a_minute_of_six_legs_is_small():
    trial = walk(seconds=60.0, rate=50.0)
    rng = np.random.default_rng(1)
    names = ('force', 'position', 'pressure', 'setpoint', 'wet_probability', 'friction', 'margin',
             'slip_speed', 'slipping', 'dome')  # fmt: skip
    trial = dataclasses.replace(
        trial, legs=(1, 2, 3, 4, 5, 6),
        **{name: np.concatenate(3 * [getattr(trial, name)], axis=1) for name in names},
    )  # fmt: skip
    trial.position += rng.normal(0.0, 1e-3, trial.position.shape)
    trial.pressure += rng.normal(0.0, 100.0, trial.pressure.shape)
    text = animation.element(view_of(trial))
    assert len(text) < 500_000


def without(trial, **unknown):
    return dataclasses.replace(
        trial, **{name: np.full_like(getattr(trial, name), np.nan) for name in unknown}
    )


def test_a_robot_without_a_motion_capture_system():
    trial = dataclasses.replace(without(walk(), body=True), floor=None, settings={})
    view = view_of(trial)
    content = animation.data(view)
    assert content['body'] is None and content['floor'] is None and content['outline'] == []
    assert whole(content['feet'][0]['x'])[at(content, 12.52)] == 1400
    said = ' '.join(animation.missing(view))
    assert 'pose of the body' in said
    assert 'ground' in said
    assert 'The foot' in said
    assert 'pose of the body' in animation.element(view)


def test_feet_without_markers_stand_in_the_table_alone():
    trial = walk()
    trial.position[:, 1] = np.nan
    view = view_of(trial)
    (missing,) = animation.missing(view)
    assert missing.startswith('Leg 2')
    content = animation.data(view)
    assert set(content['feet'][1]['x']) == {None}
    assert whole(content['feet'][1]['pressure'])[400] == 623


def test_without_forces_nobody_stands():
    view = view_of(without(walk(), force=True))
    assert set(animation.data(view)['feet'][0]['state']) == {'u'}
    assert 'No forces are on record' in ' '.join(animation.missing(view))


def test_without_any_place_there_is_nothing_to_play():
    view = view_of(without(walk(), body=True, position=True))
    assert animation.data(view) is None
    assert 'nothing to play' in animation.element(view)
    assert '<script' not in animation.element(view)


def test_the_heading_is_found_where_motion_capture_starts_late():
    trial = walk()
    body = trial.body.copy()
    body[:, 2] = (body[:, 2] + math.pi + 2.5) % (2.0 * math.pi) - math.pi  # with a full turn
    body[trial.time < 1.0] = np.nan
    heading = animation.data(view_of(dataclasses.replace(trial, body=body)))['body']['heading']
    assert heading[:20] == [None] * 20
    # At 0.1 rad/s and 25 frames a second each frame adds 4 mrad, and never a full turn.
    assert set(heading[30:]) <= {3, 4, 5}


def test_gaps_stay_gaps():
    trial = walk()
    trial.body[1000:1500] = np.nan
    x = whole(animation.data(view_of(trial))['body']['x'])
    assert x[at({'start': 0.0, 'step': 0.04}, 5.0)] is None
    assert x[300] == pytest.approx(1200, abs=5)


# --- in a browser --------------------------------------------------------------------------------


class Shown(html.parser.HTMLParser):
    """Cells of the table of legs, and the text with time and distance."""

    def __init__(self, text):
        super().__init__()
        self.inside, self.rows, self.said = '', [], ''
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        name = dict(attributes).get('id', '')
        if name in ('walk-legs', 'walk-status'):
            self.inside = name
        elif self.inside == 'walk-legs' and tag == 'tr':
            self.rows.append([])
        elif self.inside == 'walk-legs' and tag == 'td':
            self.rows[-1].append('')

    def handle_endtag(self, tag):
        if tag in ('tbody', 'output'):
            self.inside = ''

    def handle_data(self, data):
        if self.inside == 'walk-legs' and self.rows:
            self.rows[-1][-1] += data
        elif self.inside == 'walk-status':
            self.said += data


def browser(address, folder, *options):
    """Open a page in a headless Chromium without network; return its text."""
    assert CHROMIUM is not None
    return subprocess.run(
        [
            CHROMIUM, '--headless', '--no-sandbox', '--disable-gpu', '--disable-quic',
            '--no-first-run', '--disable-background-networking', '--disable-component-update',
            '--disable-sync', '--host-resolver-rules=MAP * ~NOTFOUND', '--enable-logging=stderr',
            f'--user-data-dir={folder / "profile"}', '--window-size=1000,1800',
            '--virtual-time-budget=3000', *options, address,
        ],
        capture_output=True, text=True, timeout=120, check=True, env={**os.environ},
    )  # fmt: skip


needs_browser = pytest.mark.skipif(CHROMIUM is None, reason='no Chromium is installed')


@needs_browser
def test_a_browser_shows_the_walk_at_the_linked_time(tmp_path):
    page = tmp_path / 'report.html'
    report.write(walk(), page)
    seen = {}
    for seconds in (4.2, 13.52):
        child = browser(f'{page.as_uri()}#t={seconds}', tmp_path, '--dump-dom')
        assert 'CONSOLE' not in child.stderr, child.stderr
        seen[seconds] = Shown(child.stdout)
    early, late = seen[4.2], seen[13.52]
    assert early.said.startswith('4.2') and early.said.endswith('0.42 m ahead')
    assert late.said.startswith('13.5') and late.said.endswith('1.35 m ahead')
    assert early.rows == [
        ['1', 'stands flat, slips', '0', '0', '7', 'dry'],
        ['2', 'in the air', '0', '0', '93', '–'],
    ]
    assert late.rows == [
        ['1', 'in the air', '0', '0', '7', '–'],
        ['2', 'stands as a dome', '62', '64', '93', 'wet'],
    ]


MOVE = """
<script>
const image = () => document.getElementById('walk-near').toDataURL();
const slider = document.getElementById('walk-time');
const key = name => document.getElementById('walk').dispatchEvent(
  new KeyboardEvent('keydown', {key: name, bubbles: true}));
const said = () => document.getElementById('walk-status').textContent;
const slide = frame => { slider.value = frame; slider.dispatchEvent(new Event('input')); };
const found = [said()];
slide(0);  // as wide as the page has become
const first = image();
slide(250);
found.push(said(), image() !== first);
const grounds = [];
for (let second = 0; second < 20; second++) {
  slide(25 * second + 12);
  const cells = [...document.querySelectorAll('#walk-legs tr')].map(row => row.cells[5]);
  grounds.push(cells.map(cell => cell.textContent).join(' '));
}
found.push(grounds);
slide(0);
found.push(image() === first);
key('ArrowRight');
found.push(said(), image() !== first);
key(' ');
found.push(document.getElementById('walk-play').textContent);
const wait = setInterval(() => {
  if (parseFloat(said()) <= 0.2) return;
  clearInterval(wait);
  key(' ');
  found.push(document.getElementById('walk-play').textContent, parseFloat(said()));
  document.title = JSON.stringify(found);
}, 20);
</script>
</body>
"""


@needs_browser
def test_slider_keys_and_play_move_the_picture(tmp_path):
    page = tmp_path / 'report.html'
    # Stripes are 60 mm wide; the first wet one begins at 10 mm.
    stripes = Floor(np.array([[True, False]]), 0.06, (0.01, 0.0), 3e-4)
    report.write(dataclasses.replace(walk(), floor=stripes), page)
    page.write_text(page.read_text(encoding='utf-8').replace('</body>', MOVE), encoding='utf-8')
    child = browser(page.as_uri(), tmp_path, '--dump-dom')
    assert 'CONSOLE' not in child.stderr, child.stderr
    title = child.stdout.partition('<title>')[2].partition('</title>')[0]
    first, there, moved, grounds, back, *rest = json.loads(title)
    stepped, again, playing, stopped, seconds = rest
    # The standing foot is 0.2 m ahead of the body's position at the start of the second.
    words = ['dry' if (100 * second + 190) // 60 % 2 else 'wet' for second in range(20)]
    assert grounds == [
        f'– {word}' if second % 2 else f'{word} –' for second, word in enumerate(words)
    ]
    # The animation does not start by itself.
    assert first.startswith('0.00 s')
    assert there.startswith('10.00 s') and moved and back
    assert stepped.startswith('0.20 s') and again
    assert (playing, stopped) == ('Pause', 'Play')
    assert seconds > 0.2


@needs_browser
def test_a_browser_shows_what_a_robot_left(tmp_path):
    trial = dataclasses.replace(without(walk(), body=True), floor=None, settings={})
    page = tmp_path / 'report.html'
    report.write(trial, page)
    child = browser(f'{page.as_uri()}#t=13.52', tmp_path, '--dump-dom')
    assert 'CONSOLE' not in child.stderr, child.stderr
    shown = Shown(child.stdout)
    assert shown.said.strip() == '13.52 s' or shown.said.startswith('13.5')
    assert shown.rows[1][1:] == ['stands as a dome', '62', '64', '93', '–']

# SPDX-License-Identifier: Apache-2.0
"""The page of ``pad explore`` in a headless Chromium, and how it is served."""

import asyncio
import dataclasses
import json
import os
import shutil
import signal
import socket
import subprocess
import sys
import time
import urllib.error
import urllib.parse
import urllib.request
import zipfile
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager

import pytest

from ros_pad import cli
from ros_pad.contact import Foot
from ros_pad.reports import explore_page
from ros_pad.signals import INTERRUPTED

pytest.importorskip('nicegui', reason="the extra is missing: pip install 'ros_pad[explore]'")


CHROMIUM = next(filter(None, map(shutil.which, ('chromium', 'chromium-browser', 'chrome'))), None)
OPTIONS = (
    *('--no-sandbox', '--disable-gpu', '--disable-quic', '--no-first-run', '--disable-sync'),
    *('--disable-background-networking', '--disable-component-update'),
    '--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE 127.0.0.1',
)
LONGEST = 60e3  # ms, until an answer comes, however slow the machine


@contextmanager
def served(*words):
    """Run ``pad explore`` with arguments; yield the address of its page, and the process."""
    environment = {name: value for name, value in os.environ.items() if 'PYTEST' not in name}
    child = subprocess.Popen(
        [sys.executable, '-m', 'ros_pad', 'explore', '--no-browser', *words],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=environment,
    )
    try:
        address = child.stdout.readline().partition(' ')[0]
        while not listens(address):
            if child.poll() is not None:
                raise RuntimeError(f'pad explore ended: {child.communicate()[1]}')
            time.sleep(0.05)
        yield address, child
    finally:
        child.send_signal(signal.SIGTERM)
        child.communicate(timeout=60)


def listens(address):
    parts = urllib.parse.urlsplit(address)
    try:
        socket.create_connection((parts.hostname, parts.port)).close()
    except OSError:
        return False
    return True


@contextmanager
def browser():
    """Yield a headless Chromium that finds no host but this one."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as play:
        found = play.chromium.launch(executable_path=CHROMIUM, args=[*OPTIONS])
        try:
            yield found
        finally:
            found.close()


def opened(chromium, address):
    """Return a page with its first answer."""
    page = chromium.new_page()
    page.set_default_timeout(LONGEST)
    page.goto(address)
    page.wait_for_selector('[data-answer]')
    return page


def slider_of(page, label):
    """Return a slider by the label of its field."""
    names = f'[aria-label="{label}"], [aria-label^="{label},"]'  # the second has a unit
    return page.locator(f'input[type=range]:is({names})')


@pytest.fixture(scope='module')
def page():
    """Yield a page of large37 with the addresses that it has asked for."""
    pytest.importorskip('playwright')
    if CHROMIUM is None:
        pytest.skip('no Chromium is installed')
    with served('large37') as (address, _), browser() as chromium:
        context = chromium.new_context(accept_downloads=True)
        asked: list[str] = []
        context.on('request', lambda request: asked.append(request.url))
        found = opened(context, address)
        found.on('websocket', lambda line: asked.append(line.url))
        found.asked = asked
        yield found


def answers(page):
    return int(page.locator('[data-answer]').get_attribute('data-answer'))


def typed(page, name, value):
    """Type a value, and wait for an answer to it."""
    before = answers(page)
    page.locator(f'input[type=number][name={name}]').fill(value)
    page.wait_for_function(f"document.querySelector('[data-answer]').dataset.answer > {before}")
    page.wait_for_function("!document.querySelector('.stale')")


def shown(page, key):
    return float(page.locator(f'#{key}').inner_text().split()[0])


def error_at(page, name):
    control = page.locator('.control', has=page.locator(f'input[type=number][name={name}]'))
    return ' '.join(control.locator('.error').all_inner_texts())


def test_a_slider_moves_the_numbers_to_those_of_pad_contact(page, capsys):
    before = answers(page)
    slider = slider_of(page, 'Pressure')
    slider.focus()
    page.keyboard.press('ArrowLeft')
    page.wait_for_function("document.querySelector('[name=pressure]').value === '76'")
    page.wait_for_function(f"document.querySelector('[data-answer]').dataset.answer > {before}")
    assert answers(page) == before + 1  # one change, one answer
    options = ('--foot', 'large37', '--pressure', '76000', '--force', str(5.6 / 37), '--json')
    assert cli.main(['contact', *options]) == 0
    said = json.loads(capsys.readouterr().out)
    for key, value in {
        'free-height': 1e3 * said['free']['height_m'],
        'pressed-gap': 1e3 * said['pressed']['gap_m'],
        'pressed-contact_radius': 1e3 * said['pressed']['contact_radius_m'],
        **{f'limit-{name}': limit for name, limit in said['force_limit_n'].items()},
    }.items():
        assert shown(page, key) == float(f'{value:.4g}'), key
    assert page.locator('#ring-height').inner_text() == '–'  # not valid: wider than the pad
    drawn = page.locator('[aria-label*="Cut through one pad"]').get_attribute('aria-label')
    assert f'contact radius {1e3 * said["pressed"]["contact_radius_m"]:.3g} mm' in drawn


def test_bad_input_is_marked_where_it_is_and_the_rest_stays(page):
    grip = shown(page, 'grip-flat-dry')
    typed(page, 'film', '50')
    assert 'film = 50.0 is not allowed: a number from 0.001 to 10 mm' in error_at(page, 'film')
    assert page.locator('#grip-dome-wet').inner_text() == '–'
    assert shown(page, 'grip-flat-dry') == grip
    typed(page, 'film', '0.3')
    assert error_at(page, 'film') == ''
    assert shown(page, 'grip-dome-wet') > 0.0
    typed(page, 'load', '30')
    assert 'the contact would cover the whole pad' in error_at(page, 'load')
    assert page.locator('#pressed-gap').inner_text() == '–'
    typed(page, 'load', '5.6')
    # What is typed moves the slider, too.
    assert slider_of(page, 'Load on the foot').input_value() == '5.6'


def test_a_foot_file_names_no_origin_of_what_was_chosen():
    foot = dataclasses.replace(Foot.load('large37'), sole_radius=0.02, ceiling=80e3)
    lines = explore_page.foot_file(foot).splitlines()
    for name in ('sole_radius', 'ceiling', 'chamber_volume'):
        assert 'start foot' not in next(line for line in lines if line.startswith(name))


def test_the_foot_file_walks(page, tmp_path, capsys):
    typed(page, 'pads', '61')
    typed(page, 'sole_radius', '20')
    with page.expect_download() as loading:
        page.get_by_role('button', name='Foot file').click()
    path = tmp_path / 'foot.yaml'
    loading.value.save_as(path)
    foot = Foot.load(path)
    assert (foot.pads, foot.sole_radius) == (61, 0.02)
    walk = ('hexapod_patches', '--foot', str(path), '--cycles', '1', '--fidelity', 'L1')
    options = ('--no-ros', '--no-compare', '--json', '--out', str(tmp_path / 'walk'))
    assert cli.main(['run', *walk, *options]) == 0
    assert json.loads(capsys.readouterr().out)


def test_the_moulds_are_those_of_the_command_or_refused_in_words(page, tmp_path):
    pytest.importorskip('manifold3d')
    typed(page, 'pads', '7')
    typed(page, 'sole_radius', '9')
    with page.expect_download(timeout=LONGEST) as loading:
        page.get_by_role('button', name='Moulds').click()
    loading.value.save_as(tmp_path / 'moulds.zip')
    with zipfile.ZipFile(tmp_path / 'moulds.zip') as archive:
        archive.extractall(tmp_path / 'page')
    foot = tmp_path / 'page' / 'my_foot.yaml'
    assert Foot.load(foot).pads == 7
    assert cli.main(['mould', str(foot), '--out', str(tmp_path / 'command')]) == 0
    for name in ('bone.stl', 'spacer.dxf', 'test_piece/cap.stl'):
        made = [(tmp_path / each / name).read_bytes() for each in ('page', 'command')]
        assert made[0] == made[1]
    typed(page, 'sole_radius', '7')
    page.get_by_role('button', name='Moulds').click()
    page.get_by_text('sole_radius of at least').wait_for()


def test_nothing_is_loaded_from_elsewhere(page):
    page.reload()
    page.wait_for_selector('[data-answer]')
    hosts = {urllib.parse.urlsplit(each).hostname for each in page.asked}
    assert hosts <= {'127.0.0.1', None}  # data has no host
    assert any(each.startswith('ws') for each in page.asked)


def test_other_names_and_pages_are_refused_and_ctrl_c_ends_it():
    with served() as (address, child):
        with urllib.request.urlopen(address) as answer:
            assert answer.status == 200
        socket_io = f'{address}_nicegui_ws/socket.io/?EIO=4&transport=polling'
        for page, header in (address, 'Host'), (socket_io, 'Origin'):
            request = urllib.request.Request(page, headers={header: 'http://elsewhere.example'})
            with pytest.raises(urllib.error.HTTPError, match='400'):
                urllib.request.urlopen(request)
        own = urllib.request.Request(socket_io, headers={'Origin': address.rstrip('/')})
        with urllib.request.urlopen(own) as answer:
            assert answer.status == 200
        child.send_signal(signal.SIGINT)
        assert child.wait(timeout=60) == INTERRUPTED
        refused, *said = child.stderr.read().splitlines()
        assert 'elsewhere.example is not an accepted origin' in refused
        assert said == ['pad: stopped']


class Shown:
    """In place of the elements of a page: keeps what is set in them."""

    def __init__(self):
        self.said = []

    def classes(self, **words):
        self.said.append(words)

    def set_text(self, text):
        self.said.append(text)


def test_an_answer_that_fails_leaves_no_old_numbers_as_new(monkeypatch):
    def compute(inputs):
        raise ValueError('broken')

    monkeypatch.setattr(explore_page, 'answer', compute)
    element = Shown()

    async def play():
        page = explore_page.Page({'load': 0})
        page._status, page._answers = element, (element,)
        with pytest.raises(ValueError, match='broken'):
            await page.answer()

    with ThreadPoolExecutor() as pool:  # beside the event loop of the browser's driver
        pool.submit(asyncio.run, play()).result()
    assert element.said == [{'add': 'stale'}, 'no answer: broken']


def test_without_the_extra_the_remedy_is_printed(monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, 'nicegui', None)
    assert cli.main(['explore', '--no-browser']) == 1
    said = capsys.readouterr()
    assert said.out == ''
    assert "pip install 'ros_pad[explore]'" in said.err
